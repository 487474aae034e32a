"""What a wheel carries, and how it is made; see docs/install.md."""
