"""The paper's figures and tables, and what of them holds."""
