"""Reading what anybody made: limits on sizes, zip archives, XML, kinds of values."""
