"""Node parameters: their models, defaults, and how a node declares and checks them."""
