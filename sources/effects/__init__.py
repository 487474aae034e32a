"""One physical law per file; each can be added to any balance of a fitting kind."""
