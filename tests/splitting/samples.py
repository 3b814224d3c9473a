"""Random and adversarial samples for the search of splits."""

import numpy as np


def tied_sample(generator, kind, largest=120):
    """Return (x, q) with ties, atoms, lattices, near-equal values or none, by ``kind``."""
    n = int(generator.integers(2, largest))
    x, q = generator.normal(size=(n, 2)), generator.normal(size=n)
    match kind % 15:
        case 1:
            x = np.round(2 * x)
        case 2:
            q = np.round(2 * q)
        case 3:
            x, q = np.round(5 * x), np.round(3 * q)
        case 4:
            q = q + x[:, 0]
        case 5:
            q = np.where(generator.random(n) < 0.7, 0.0, q)
        case 6:
            x[:, 0] = 1.0 + np.spacing(1.0) * generator.integers(0, n, size=n)
        case 7:
            x[:, 0] = generator.standard_cauchy(size=n) ** 5
        case 8:
            x = np.where(x > 0, 0.0, -0.0)
            x[:, 1] = generator.integers(0, 3, size=n)
        case 9:
            q = np.zeros(n)
        case 10:
            x[:] = 4.0
        case 11:
            x[:, 1], q = np.arange(n), -np.arange(n, dtype=float)
        case 12:
            x[:, 0], q = np.arange(n), (np.arange(n) * 0.618033988749895) % 1.0
        case 13:
            x = np.sign(x) * 1e308 * generator.random(size=(n, 2))
        case 14:
            q = 1.0 + 1e-15 * generator.integers(0, 9, size=n)
    return x, q


def adversarial_returns(n, seed=0):
    """Yield (name, q in the order of the attribute): inputs that could defeat the bounds."""
    generator = np.random.default_rng(seed)
    i, x = np.arange(n), np.linspace(0.0, 1.0, n)
    bits = max(1, int(n - 1).bit_length())
    yield "noise", generator.normal(size=n)
    yield "golden lattice", (i * 0.618033988749895) % 1.0
    yield "bit reversal", np.array([int(f"{k:0{bits}b}"[::-1], 2) for k in i], dtype=float)
    yield "q = x", x
    yield "q = x + noise", x + generator.normal(size=n)
    yield "q = x + little noise", x + 0.1 * generator.normal(size=n)
    yield "abs", np.abs(x - 0.5)
    yield "zigzag", (20 * x) % 1.0
    yield "swapped halves", (x + 0.5) % 1.0
    yield "drift", np.cumsum(generator.normal(size=n))
    yield "variance drift", (1 + 2 * x) * generator.normal(size=n)
    yield "flat ridge", (i % 2).astype(float)
    yield "rare binary", (generator.random(n) < 0.01).astype(float)
    yield "three values", generator.integers(0, 3, size=n).astype(float)
    yield "constant", np.zeros(n)
    yield "fifty values", generator.integers(0, 50, size=n).astype(float)
    yield "step", generator.normal(size=n) + (x > 0.3)
