"""Values of small Bellman equations without rounding: by fractions, or with many digits."""

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np

DIGITS = 34


def pairs_of(posed):
    """[s][...] of (reward, {successor: probability}) per available action, as exact fractions."""
    model, rewards = posed.transitions.model, posed.rewards
    table = [[None] * model.n_actions for _ in range(model.n_states)]
    for state, action in np.argwhere(posed.mdp.available):
        table[state][action] = (Fraction(float(rewards[state, action])), {})
    for entry, row in enumerate(model.row):
        state, action = divmod(int(row), model.n_actions)
        successors = table[state][action][1]
        after, share = (
            int(model.successor[entry]),
            Fraction(float(posed.transitions.entries[entry])),
        )
        successors[after] = successors.get(after, Fraction(0)) + share
    return [[pair for pair in row if pair is not None] for row in table]


def exact_hard_value(posed):
    """(S,) V* of the hard equation as fractions, by policy iteration."""
    pairs, discount = pairs_of(posed), Fraction(posed.discount)
    choice = [0] * len(pairs)
    while True:
        chosen = [row[pick] for row, pick in zip(pairs, choice, strict=True)]
        value = _solved(chosen, discount)
        q = [[_q(pair, value, discount) for pair in row] for row in pairs]
        better = [max(range(len(row)), key=row.__getitem__) for row in q]
        if all(row[new] == v for row, new, v in zip(q, better, value, strict=True)):
            return value
        choice = better


def exact_soft_value(posed):
    """(S,) V* of the soft equation to some 25 digits, by sweeps."""
    with localcontext() as context:
        context.prec = DIGITS
        discount, pairs = _decimal(Fraction(posed.discount)), _decimal_pairs(pairs_of(posed))
        value = [Decimal(0)] * len(pairs)
        small = Decimal(10) ** (8 - DIGITS)
        while True:
            swept = [_log_sum_exp([_q(pair, value, discount) for pair in row]) for row in pairs]
            moved = max(abs(a - b) for a, b in zip(swept, value, strict=True))
            value = swept
            if moved <= small * (1 - discount) * max(1, *map(abs, value)):
                return [Fraction(v) for v in value]


def largest_error(value, exact):
    """max |value - exact| of (S,) floats, as a fraction."""
    return max(abs(Fraction(float(v)) - e) for v, e in zip(value, exact, strict=True))


def _q(pair, value, discount):
    reward, successors = pair
    return reward + discount * sum(p * value[s] for s, p in successors.items())


def _solved(chosen, discount):
    """Gauss and Jordan on (I - gamma P) v = r."""
    n = len(chosen)
    table = [
        [int(i == j) - discount * successors.get(j, 0) for j in range(n)] + [reward]
        for i, (reward, successors) in enumerate(chosen)
    ]
    for i in range(n):
        table[i] = [x / table[i][i] for x in table[i]]
        for k in set(range(n)) - {i}:
            table[k] = [x - table[k][i] * y for x, y in zip(table[k], table[i], strict=True)]
    return [row[n] for row in table]


def _log_sum_exp(q):
    highest = max(q)
    return highest + sum((x - highest).exp() for x in q).ln()


def _decimal(number):
    return Decimal(number.numerator) / Decimal(number.denominator)


def _decimal_pairs(pairs):
    return [
        [(_decimal(reward), {s: _decimal(p) for s, p in after.items()}) for reward, after in row]
        for row in pairs
    ]
