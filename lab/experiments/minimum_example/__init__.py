"""The minimum example of the thesis (section 4.6.1), whose demonstrations have two explanations."""
