"""One module per verb; each returns a frozen Result dataclass."""
