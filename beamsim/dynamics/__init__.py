"""Mathematics of motion: contact states, the closed-form flow, event search, time stepping as a check."""
