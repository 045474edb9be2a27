from support.small_problems import counted  # noqa: F401
