"""The detour study: a ring corridor where the short way leads against the flow."""
