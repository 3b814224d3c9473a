"""Small tasks of other papers, and who demonstrates them."""
