"""Simultaneous estimation of rewards and dynamics on discrete Markov decision processes.

    problem      an MDP without reward (`mdp`, `dynamics`) and reward features (`problem`)
    decisions    what an expert did (`demonstrations`)
    learners     SERD and inverse reinforcement learning, one file each
    policies     what follows from learned rewards and dynamics; `arrival` says when it arrives
    uncertainty  standard errors, and what the data cannot tell

    from serd_core.learners.mdce_serd import fit_mdce_serd
    fit = fit_mdce_serd(problem, decisions, rng=np.random.default_rng(1))

Only NumPy and SciPy are used; nothing here reads files or clocks, prints, or knows of robots.
"""
