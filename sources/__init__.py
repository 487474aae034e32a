"""What a component is, and how it becomes an FMU."""
