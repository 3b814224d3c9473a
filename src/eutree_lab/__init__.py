"""Research with eutree: methods and tasks of other papers, and the experiments of the paper."""
