"""The Krylov solvers of scipy and, where petsc4py is there, of PETSc on a T in blocks storage, beside frames of counterlight.

    bench_krylov.py COUNTERLIGHT T.h5 [TARGET_ERROR]

All solve S l = b, l = F x, for the picture of `counterlight bench`: scipy in single precision with products by the blocks
themselves and by compressed rows of 128 entries (light of 128 tiles of the grid), PETSc in its own precision by the same
rows. Times are medians of three, all channels, from nothing and warm from the picture before; matrices are made before the
clock starts. Errors are by the whole T.
"""
import json
import statistics
import subprocess
import sys
import time

import h5py
import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as solvers

try:
    import petsc4py
    petsc4py.init([])
    from petsc4py import PETSc
except ImportError:
    PETSc = None

TILES_ACROSS, TILES_DOWN, TURNS = 16, 8, 3


class Channel:
    """T of one channel: near + C e + P D^-1 C' w (x - P e), e the mean of x over blocks by flux (docs/transport-file.md)."""

    def __init__(self, file, channel):
        blocks = file["blocks"]
        self.width, self.height = int(file.attrs["width"]), int(file.attrs["height"])
        self.cells = self.width * self.height
        self.block, self.flux = blocks["block"][:], blocks["flux"][:]
        count = blocks["column"].shape[1]
        self.columns = np.ascontiguousarray(blocks["column"][channel])
        total = np.bincount(self.block, self.flux, count)
        self.inverse = np.divide(1, total, out=np.zeros(count), where=total > 0).astype(np.float32)
        self.near = sparse.csr_matrix((blocks["value"][channel], blocks["cell"][:], blocks["start"][:]), shape=(self.cells,) * 2)
        means = np.array([np.bincount(self.block, self.flux * column, count) for column in self.columns]) * self.inverse
        own = self.columns[self.block, np.arange(self.cells)]
        far = self.flux * self.inverse[self.block] * (2 * own - means[self.block, self.block])
        self.first = (self.near.diagonal() + far).astype(np.float32)

    def apply(self, x):
        e = np.bincount(self.block, self.flux * x, len(self.inverse)).astype(np.float32) * self.inverse
        z = self.columns @ (self.flux * (x - e[self.block]))
        return self.near @ x + e @ self.columns + (self.inverse * z)[self.block]

    def scaled(self, light):
        return self.apply((light / self.first).astype(np.float32))

    def rows(self):
        """S in compressed rows: the diagonal, and the light of tiles for the l of the cell in their middle."""
        y, x = np.divmod(np.arange(self.cells), self.width)
        tile = y * TILES_DOWN // self.height * TILES_ACROSS + x * TILES_ACROSS // self.width
        values, middles = [], []
        for k in range(TILES_ACROSS * TILES_DOWN):
            inside = tile == k
            values.append(self.scaled(inside.astype(np.float32)) - inside)
            members = np.flatnonzero(inside)
            middles.append(members[np.argmin((x[members] - x[members].mean()) ** 2 + (y[members] - y[members].mean()) ** 2)])
        order = np.argsort(middles)
        columns = np.tile(np.array(middles, dtype=np.int32)[order], self.cells)
        start = np.arange(self.cells + 1, dtype=np.int32) * len(order)
        far = sparse.csr_matrix((np.array(values, dtype=np.float32)[order].T.ravel(), columns, start), shape=(self.cells,) * 2)
        return (far + sparse.identity(self.cells, dtype=np.float32, format="csr")).tocsr()


def picture(channel, number, index):
    """The drive that `counterlight bench` shows in frame `number`."""
    at = np.arange(channel.cells)
    x = at % channel.width / channel.width + 0.004 * number
    y = at // channel.width / channel.height - 0.002 * number
    return (0.5 + 0.35 * np.sin(13 * x + 2 * index) * np.cos(9 * y)).astype(np.float32)


def by_scipy(solver, operators, tolerance):
    def solve(wanted, start):
        return [solver(a, b, x0=x0, tol=tolerance, atol=0)[0] for a, b, x0 in zip(operators, wanted, start)]
    return solve


def by_petsc(kind, matrices, tolerance):
    kept = []
    for matrix in matrices:
        a = PETSc.Mat().createAIJ(size=matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data.astype(np.float64)))
        ksp = PETSc.KSP().create()
        ksp.setOperators(a)
        ksp.setType(kind)
        ksp.getPC().setType("none")
        ksp.setTolerances(rtol=tolerance)
        ksp.setInitialGuessNonzero(True)
        kept.append((ksp, *a.createVecs()))

    def solve(wanted, start):
        answers = []
        for (ksp, x, b), want, first in zip(kept, wanted, start):
            b.setArray(want)
            x.setArray(first)
            ksp.solve(b, x)
            answers.append(x.getArray().copy())
        return answers
    return solve


def measure(name, solve, channels, frame):
    shown = [[c.apply(picture(c, number, k)) for k, c in enumerate(channels)] for number in range(TURNS + 1)]
    nothing = [np.zeros(c.cells, dtype=np.float32) for c in channels]
    cold, warm = [], []
    for _ in range(TURNS):
        since = time.perf_counter()
        light = first = solve(shown[0], nothing)
        cold.append(1e3 * (time.perf_counter() - since))
    for number in range(1, TURNS + 1):
        since = time.perf_counter()
        light = solve(shown[number], light)
        warm.append(1e3 * (time.perf_counter() - since))
    apart = sum(np.sum((c.scaled(l) - b) ** 2.0) for c, l, b in zip(channels, first, shown[0]))
    error = (apart / sum(np.sum(b ** 2.0) for b in shown[0])) ** 0.5
    cold, warm = statistics.median(cold), statistics.median(warm)
    print(f"{name:24} {cold:9.1f} ms from nothing ({cold / frame['cold_ms']:.0f} x), {warm:.1f} ms warm "
          f"({warm / frame['p50_ms']:.0f} x), {100 * error:.2f} % off", flush=True)


def main():
    program, path = sys.argv[1:3]
    tolerance = float(sys.argv[3]) if len(sys.argv) > 3 else 0.01
    answer = subprocess.run([program, "bench", path, "--no-scaling", "--json", "--target-error", str(tolerance)],
                            check=True, capture_output=True, text=True)
    frame = json.loads(answer.stdout)["frame"]
    print(f"frames                   {frame['cold_ms']:9.1f} ms from nothing, {frame['p50_ms']:.1f} ms warm")
    with h5py.File(path) as file:
        channels = [Channel(file, k) for k in range(int(file.attrs["channels"]))]
    whole = [solvers.LinearOperator((c.cells,) * 2, matvec=c.scaled, dtype=np.float32) for c in channels]
    rows = [c.rows() for c in channels]
    for solver in (solvers.gmres, solvers.lgmres, solvers.bicgstab):
        measure(f"scipy {solver.__name__} blocks", by_scipy(solver, whole, tolerance), channels, frame)
        measure(f"scipy {solver.__name__} csr-f32", by_scipy(solver, rows, tolerance), channels, frame)
    for kind in ("gmres", "bcgs") if PETSc else ():
        measure(f"petsc {kind} csr", by_petsc(kind, rows, tolerance), channels, frame)


if __name__ == "__main__":
    main()
