"""Glazing products that redirect light: what they are made of, and how they scatter."""

from transom.products.product import Product, list_products, load_product

__all__ = ["Product", "list_products", "load_product"]
