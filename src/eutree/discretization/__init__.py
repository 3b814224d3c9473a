"""Ways to cut a continuous space into finitely many states, without any learner around them."""
