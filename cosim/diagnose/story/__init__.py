"""What a diagnosis says to people: facts of its JSON, and sentences that are made of them."""
