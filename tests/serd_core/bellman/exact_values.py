"""Values of small Bellman equations without rounding: by fractions, or with many digits."""

from decimal import Decimal, localcontext
from fractions import Fraction

DIGITS = 34


def pairs_of(posed, number=lambda fraction: fraction):
    """[s][...] of (reward, {successor: probability}) per available action, as exact numbers."""
    model = posed.transitions.model
    table = [[] for _ in range(model.n_states)]
    matrix = posed.transitions.matrix
    for row in range(model.n_states * model.n_actions):
        state, action = divmod(row, model.n_actions)
        if not posed.mdp.available[state, action]:
            continue
        successors = {}
        for entry in range(*matrix.indptr[row : row + 2]):
            after, share = int(matrix.indices[entry]), Fraction(float(matrix.data[entry]))
            successors[after] = successors.get(after, Fraction(0)) + share
        reward = Fraction(float(posed.rewards[state, action]))
        table[state].append((number(reward), {s: number(p) for s, p in successors.items()}))
    return table


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
        pairs, discount = pairs_of(posed, _decimal), _decimal(Fraction(posed.discount))
        value, moved = [Decimal(0)] * len(pairs), Decimal(1)
        while moved > Decimal(10) ** (8 - DIGITS) * (1 - discount) * max(1, *map(abs, value)):
            swept = []
            for row in pairs:
                q = [_q(pair, value, discount) for pair in row]
                swept.append(max(q) + sum((x - max(q)).exp() for x in q).ln())
            moved = max(abs(a - b) for a, b in zip(swept, value, strict=True))
            value = swept
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


def _decimal(number):
    return Decimal(number.numerator) / Decimal(number.denominator)
