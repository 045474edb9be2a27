"""What learning costs, here and in other libraries."""
