"""What is installed here: scenarios, FMUs, and the sources that build more of them."""
