"""CART: a classification tree of a given number of leaves, from weighted observations."""

from eutree.cart.tree import grow_cart

__all__ = ["grow_cart"]
