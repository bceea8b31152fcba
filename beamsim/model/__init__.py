"""Physics without time: elements, chains, damping, snubbers, forcing, reduction, and the bridge `build_system`."""
