"""Every method from every start, and the worth of teaching to each."""
