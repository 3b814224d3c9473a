"""A study with people: each one is led through the same parts; a table of all of them."""
