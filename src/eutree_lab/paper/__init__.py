"""The paper's figures and tables, and which of their claims hold."""
