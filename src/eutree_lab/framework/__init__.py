"""Every method from every start, and what teaching is worth to each."""
