"""Neural rivals in PyTorch: `mlp`, four layers of 400, predicts how the state changes;
`symplectic`, a network with three hidden layers of 512 for T and one for V, moves the state on
by leapfrog (Chen, Zhang, Arjovsky and Bottou, Symplectic Recurrent Neural Networks, 2020).

network.py WHICH PAIRS STARTS OUT SECONDS

Adam on squared errors over batches of 200 pairs, the rate falling from 1e-3 to 1e-6 like a cosine
over SECONDS of processor time; single precision.
"""

import math
import sys
import time

from peer import say

import numpy as np
import torch
from torch import nn

import pairs

torch.set_num_threads(1)
torch.manual_seed(0)
which, pairs_path, starts_path, out, budget = sys.argv[1:]
budget = float(budget)
BATCH, FIRST_RATE, LAST_RATE = 200, 1e-3, 1e-6


def layers(sizes, function):
    parts = []
    for a, b in zip(sizes, sizes[1:]):
        parts += [nn.Linear(a, b), function()]
    return nn.Sequential(*parts[:-1])


class Mlp(nn.Module):
    def __init__(self):
        super().__init__()
        self.change = layers([4, 400, 400, 400, 400, 4], nn.ReLU)

    def forward(self, state):
        return state + self.change(state)


class Symplectic(nn.Module):
    def __init__(self):
        super().__init__()
        self.kinetic = layers([2, 512, 512, 512, 1], nn.Tanh)
        self.potential = layers([2, 512, 512, 512, 1], nn.Tanh)

    def forward(self, state):
        def slope(energy, at):
            at = at if at.requires_grad else at.requires_grad_()
            return torch.autograd.grad(energy(at).sum(), at, create_graph=True)[0]

        q, p = state[:, :2].clone(), state[:, 2:].clone()
        p = p - pairs.STEP / 2 * slope(self.potential, q)
        q = q + pairs.STEP * slope(self.kinetic, p)
        p = p - pairs.STEP / 2 * slope(self.potential, q)
        return torch.cat([q, p], dim=1)


model = Mlp() if which == "mlp" else Symplectic()
before, after = (torch.tensor(x, dtype=torch.float32) for x in pairs.read(pairs_path))
optimizer = torch.optim.Adam(model.parameters(), lr=FIRST_RATE)
clock, epochs, done = time.process_time(), 0, 0.0
while done < 1.0:
    for batch in torch.randperm(len(before)).split(BATCH):
        done = min(1.0, (time.process_time() - clock) / budget)
        cosine = (1.0 + math.cos(math.pi * done)) / 2
        for group in optimizer.param_groups:
            group["lr"] = LAST_RATE + (FIRST_RATE - LAST_RATE) * cosine
        optimizer.zero_grad()
        (model(before[batch]) - after[batch]).square().mean().backward()
        optimizer.step()
        if done >= 1.0:
            break
    epochs += 1
seconds = time.process_time() - clock


def ahead(states):
    states = torch.tensor(np.asarray(states), dtype=torch.float32)
    return model(states).detach().numpy()


pairs.predict(starts_path, ahead, out)
count = sum(parameter.numel() for parameter in model.parameters())
say(version=torch.__version__, seconds=seconds, epochs=epochs, parameters=count)
