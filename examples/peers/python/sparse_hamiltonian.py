"""The method of DiPietro, Xiong and Zhu (Sparse Symplectically Integrated Neural Networks,
NeurIPS 2020) in PyTorch, for Hénon-Heiles.

sparse_hamiltonian.py PAIRS STARTS OUT LIMIT

T and V are weighted sums of x^i y^j with i, j up to 3; their gradients, by automatic
differentiation, move each pair's first state on by two steps of Forest and Ruth's method. The
settings are the paper's: absolute errors, an L1 penalty of 1e-3 on the weights, Adam at a rate of
0.01 that falls by 0.8 every 100 pairs and starts again lower in epochs 3, 4 and 5, one pair at a
time, six epochs over four fifths of the pairs, single precision. LIMIT ends it after so many
seconds of processor time; 0 lets it finish.
"""

import sys
import time

from peer import say

import numpy as np
import torch

import pairs

torch.set_num_threads(1)
torch.manual_seed(0)
pairs_path, starts_path, out, limit = sys.argv[1:]
limit = float(limit) or float("inf")
DEGREE, PENALTY, RATE = 3, 1e-3, 1e-2
EPOCHS, RESTARTS = 6, {2: 1e-3, 3: 1e-4, 4: 1e-5}
ROOT = 2.0 ** (1.0 / 3.0)
KICKS = [1.0 / (2.0 - ROOT), -ROOT / (2.0 - ROOT), 1.0 / (2.0 - ROOT)]
DRIFTS = [KICKS[0] / 2, (KICKS[0] + KICKS[1]) / 2, (KICKS[1] + KICKS[2]) / 2, KICKS[2] / 2]
powers = torch.arange(0, DEGREE + 1)


class Space(torch.nn.Module):
    """Gradient of a weighted sum of all monomials but the constant."""

    def __init__(self):
        super().__init__()
        self.weights = torch.nn.Linear((DEGREE + 1) ** 2 - 1, 1, bias=False)

    def forward(self, at):
        monomials = at[..., 0, None] ** powers, at[..., 1, None] ** powers
        monomials = (monomials[0][..., :, None] * monomials[1][..., None, :]).flatten(-2)
        energy = self.weights(monomials[..., 1:]).sum()
        return torch.autograd.grad(energy, at, create_graph=True)[0]


kinetic, potential = Space(), Space()


def ahead(q, p, steps=2):
    h = pairs.STEP / steps
    for _ in range(steps):
        for drift, kick in zip(DRIFTS, KICKS):
            q = q + drift * h * kinetic(p)
            p = p - kick * h * potential(q)
        q = q + DRIFTS[3] * h * kinetic(p)
    return q, p


before, after = (torch.tensor(x, dtype=torch.float32) for x in pairs.read(pairs_path))
training = range(len(before) * 4 // 5)
parameters = [*kinetic.parameters(), *potential.parameters()]
optimizer = torch.optim.Adam(parameters, lr=RATE)
schedule = torch.optim.lr_scheduler.StepLR(optimizer, step_size=100, gamma=0.8)
clock, seen = time.process_time(), 0
for epoch in range(EPOCHS):
    if epoch in RESTARTS:
        for group in optimizer.param_groups:
            group["lr"] = RESTARTS[epoch]
    for k in training:
        if time.process_time() - clock > limit:
            break
        optimizer.zero_grad()
        q = before[k : k + 1, :2].clone().requires_grad_()
        p = before[k : k + 1, 2:].clone().requires_grad_()
        q, p = ahead(q, p)
        error = (q - after[k, :2]).abs().mean() + (p - after[k, 2:]).abs().mean()
        loss = error + PENALTY * sum(x.abs().sum() for x in parameters)
        loss.backward()
        optimizer.step()
        schedule.step()
        seen += 1
seconds = time.process_time() - clock


def truth(terms):
    weights = np.zeros((DEGREE + 1) ** 2)
    for (i, j), value in terms.items():
        weights[i * (DEGREE + 1) + j] = value
    return weights[1:]


found = np.concatenate([x.detach().numpy().ravel() for x in parameters]).astype(float)
squares = {(2, 0): 0.5, (0, 2): 0.5}
true = np.concatenate([truth(squares), truth({**squares, (2, 1): 1.0, (0, 3): -1.0 / 3.0})])


def of_numpy(states):
    states = torch.tensor(states, dtype=torch.float32)
    q, p = states[:, :2].clone().requires_grad_(), states[:, 2:].clone().requires_grad_()
    return np.concatenate([x.detach().numpy() for x in ahead(q, p)], axis=1)


pairs.predict(starts_path, of_numpy, out)
say(
    version=torch.__version__,
    seconds=seconds,
    pairs_seen=seen,
    finished=seen == EPOCHS * len(training),
    error=float(np.abs(found - true).max()),
    exact=bool(((found != 0) == (true != 0)).all()),
    parameters=len(found),
)
