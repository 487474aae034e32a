"""Systems as control engineers look at them."""
