"""A tree whose cuts may ask for what was observed and done before."""
