"""Linear systems (I - gamma P_pi) x = b: their structure and how they are solved."""
