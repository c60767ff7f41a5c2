"""The peers' side: scipy (SuperLU) or CHOLMOD with ARPACK for eigenpairs, numpy for WKS, SPAMS for Lasso and learning,
trimesh for reading. Reads one JSON command per line and answers with one JSON line."""

import json
import multiprocessing
import os
import sys
import time

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla
import spams

try:
    from sksparse.cholmod import cholesky
except ImportError:
    cholesky = None

THREADS = int(sys.argv[1]) if len(sys.argv) > 1 else 1
state = {}


def load(path, rows=None):
    values = np.fromfile(path, dtype="<f8")
    return np.asfortranarray(values.reshape(-1, rows).T) if rows else values


def solve(stiffness, mass, n, solver):
    """The n smallest eigenpairs by shift and invert."""
    shift = -1.0
    matrix = sp.diags(mass)
    if solver == "cholmod":
        factor = cholesky((stiffness - shift * matrix).tocsc())
        inverse = sla.LinearOperator(stiffness.shape, matvec=lambda b: factor(b), dtype=float)
        return sla.eigsh(stiffness, k=n, M=matrix, sigma=shift, OPinv=inverse, tol=1e-6)
    return sla.eigsh(stiffness, k=n, M=matrix.tocsc(), sigma=shift, tol=1e-6)


def best_solver():
    return "cholmod" if cholesky else "superlu"


def parse(path):
    vertices, faces = [], []
    for line in open(path):
        if line.startswith("v "):
            vertices.append(line.split()[1:4])
        elif line.startswith("f "):
            faces.append([p.split("/")[0] for p in line.split()[1:4]])
    return np.array(vertices, dtype=float), np.array(faces, dtype=int) - 1


def laplacian(v, f):
    n = len(v)
    i, j, k = f.T
    w, entries = [], []
    for a, b, c in ((i, j, k), (j, k, i), (k, i, j)):
        p, q = v[a] - v[c], v[b] - v[c]
        cot = (p * q).sum(1) / np.linalg.norm(np.cross(p, q), axis=1)
        w.append(-0.5 * cot)
        entries.append((a, b))
    rows = np.concatenate([e[0] for e in entries])
    cols = np.concatenate([e[1] for e in entries])
    m = sp.coo_matrix((np.concatenate(w), (rows, cols)), shape=(n, n)).tocsc()
    m = m + m.T
    stiffness = (m - sp.diags(np.asarray(m.sum(1)).ravel())).tocsc()
    area = np.linalg.norm(np.cross(v[j] - v[i], v[k] - v[i]), axis=1) / 2
    mass = np.bincount(f.ravel(), np.repeat(area / 3, 3), n)
    return stiffness, mass / mass.sum()


def wks(values, vectors, channel):
    n = channel["eigenpairs"]
    logs, squared = np.log(values[1:n]), vectors[:, 1:n] ** 2
    low, high = channel["low"], channel["high"]
    if low is None:
        low, high = logs[0], logs[-1] / 1.02
    grid = np.linspace(low, high, channel["energies"])
    sigma = channel["sigma_steps"] * (grid[1] - grid[0])
    exponent = -((grid[:, None] - logs[None]) ** 2) / (2 * sigma**2)
    weight = np.exp(exponent - exponent.max(1, keepdims=True))
    return (weight / weight.sum(1, keepdims=True)) @ squared.T


def signals_of(path, setup, channels, vertices=None):
    """Normalised signals of a mesh, M x N for each channel: of the named vertices, or of a training shape's sample."""
    v, f = parse(path)
    stiffness, mass = laplacian(v, f)
    values, vectors = solve(stiffness, mass, max(c["eigenpairs"] for c in channels), best_solver())
    sample = setup["parameters"]["samples_per_shape"]
    if vertices is None and 0 < sample < len(v):
        vertices = np.random.default_rng(1).choice(len(v), sample, replace=False, p=mass)
    if vertices is not None:
        vectors = vectors[vertices]
    how = setup["parameters"]["normalisation"]
    signals = []
    for channel in channels:
        s = np.maximum(wks(values, vectors, channel), 0)
        s = np.sqrt(s) if how == "sqrt_unit" else s
        signals.append(np.asfortranarray(s if how == "raw" else s / np.linalg.norm(s, axis=0)))
    return signals


def objective(signals, dictionary, parameter):
    codes = spams.lasso(signals, D=dictionary, lambda1=parameter, mode=2, numThreads=THREADS)
    residual = signals - dictionary @ codes
    return 0.5 * (residual**2).sum() + parameter * abs(codes).sum(), np.linalg.norm(residual)


def train(signals, atoms, parameter, iterations, batch):
    return spams.trainDL(
        signals, K=atoms, lambda1=parameter, mode=2, iter=iterations, batchsize=batch, numThreads=1, verbose=False
    )


def index_class(job):
    setup, meshes = job
    p = setup["parameters"]
    described = [signals_of(m, setup, setup["channels"]) for m in meshes]
    for shapes in zip(*described):
        train(np.asfortranarray(np.hstack(shapes)), p["atoms"], p["lambda"], p["iterations"], p["batch"])
    return os.getpid(), peak()


def forget_peak():
    """Lets the peak of the resident memory start afresh (Linux)."""
    try:
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")
    except OSError:
        pass


def peak():
    """The peak of the resident memory in MB; 0 where the system does not tell."""
    try:
        for line in open("/proc/self/status"):
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    except OSError:
        pass
    return 0


def clean(mesh):
    """What preparing does: no repeated or empty faces, no unused vertices, the largest component."""
    import trimesh

    mesh.update_faces(mesh.unique_faces() & mesh.nondegenerate_faces())
    labels = trimesh.graph.connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
    mesh.update_faces(labels == np.bincount(labels, mesh.area_faces).argmax())
    mesh.remove_unreferenced_vertices()
    return mesh


def run(c):
    op = c["op"]
    if op == "operators":
        d = c["dir"] + "/"
        pointers, indices = load(d + "indptr").astype(int), load(d + "indices").astype(int)
        n = len(pointers) - 1
        state["w"] = sp.csc_matrix((load(d + "data"), indices, pointers), shape=(n, n))
        state["a"] = load(d + "mass")
        return {}
    if op == "eigen":
        best = None
        # Whichever of the two is the faster is the peer.
        for solver in ("superlu", "cholmod") if cholesky else ("superlu",):
            started = time.perf_counter()
            values, _ = solve(state["w"], state["a"], c["n"], solver)
            ms = (time.perf_counter() - started) * 1e3
            if best is None or ms < best[0]:
                best = (ms, solver)
            np.sort(values).tofile(c["values"])
        return dict(ms=best[0], solver=best[1])
    if op == "close":
        a, b = load(c["a"]), load(c["b"])
        floor = 1e-6 * b[-1]
        return dict(relative=float(np.max(np.abs(a - b) / np.maximum(np.abs(b), floor))))
    if op == "learn":
        signals = load(c["signals"], c["rows"])
        started = time.perf_counter()
        d = train(signals, c["atoms"], c["parameter"], c["iterations"], c["batch"])
        ms = (time.perf_counter() - started) * 1e3
        np.asfortranarray(d).T.tofile(c["dictionary"])
        return dict(ms=ms)
    if op == "objective":
        total, _ = objective(load(c["signals"], c["rows"]), load(c["dictionary"], c["rows"]), c["parameter"])
        return dict(objective=total)
    if op == "dictionary":
        state["d"], state["s"] = load(c["dictionary"], c["rows"]), load(c["signals"], c["rows"])
        return {}
    if op == "lasso":
        started = time.perf_counter()
        for _ in range(c["calls"]):
            codes = spams.lasso(state["s"], D=state["d"], lambda1=c["parameter"], mode=2, numThreads=THREADS)
        ms = (time.perf_counter() - started) * 1e3 / c["calls"]
        residual = state["s"] - state["d"] @ codes
        return dict(ms=ms, objective=float(0.5 * (residual**2).sum() + c["parameter"] * abs(codes).sum()))
    if op == "index":
        jobs = [(c["setup"], k["meshes"]) for k in c["classes"]]
        started = time.perf_counter()
        with multiprocessing.Pool(THREADS) as pool:
            peaks = dict(sorted(pool.map(index_class, jobs, chunksize=1), key=lambda p: p[1]))
        return dict(ms=(time.perf_counter() - started) * 1e3, mb=peak() + sum(peaks.values()))
    if op == "load":
        import pathlib

        state["setup"] = c["setup"]
        # Closed queries are coded in the first channel, the plain one.
        energies = c["setup"]["channels"][0]["energies"]
        files = sorted(pathlib.Path(c["dir"]).iterdir())
        state["index"] = {p.name: load(p, energies) for p in files}
        return {}
    if op == "query":
        setup = state["setup"]
        frobenius_wanted = setup["parameters"]["rank_by"] == "frobenius"
        started = time.perf_counter()
        (signals,) = signals_of(c["mesh"], setup, setup["channels"][:1], c["vertices"])
        scores = {}
        for name, d in state["index"].items():
            total, frobenius = objective(signals, d, setup["parameters"]["lambda"])
            scores[name] = frobenius if frobenius_wanted else total / signals.shape[1]
        best = min(scores, key=scores.get)
        return dict(ms=(time.perf_counter() - started) * 1e3, best=best, score=float(scores[best]))
    if op == "convert":
        import trimesh

        mesh = trimesh.load(c["mesh"], process=False)
        for kind in ("ply", "glb"):
            mesh.export(f"{c['out']}/big.{kind}")
        return {}
    if op == "read":
        import meshio
        import trimesh

        best = None
        # Whichever reads faster is the peer; meshio knows no glTF.
        for reader in ("trimesh",) if c["mesh"].endswith("glb") or c["clean"] else ("trimesh", "meshio"):
            started = time.perf_counter()
            if reader == "meshio":
                faces = len(meshio.read(c["mesh"]).cells_dict["triangle"])
            else:
                mesh = trimesh.load(c["mesh"], process=c["clean"], force="mesh")
                faces = len(clean(mesh).faces if c["clean"] else mesh.faces)
            ms = (time.perf_counter() - started) * 1e3
            if best is None or ms < best[0]:
                best = (ms, faces, reader)
        return dict(ms=best[0], faces=best[1], reader=best[2])
    raise ValueError(op)


if __name__ == "__main__":
    for line in sys.stdin:
        try:
            forget_peak()
            answer = {"mb": 0, **run(json.loads(line))}
            answer["mb"] = answer["mb"] or peak()
        except Exception as error:  # The other side shows it and stops.
            answer = dict(error=f"{type(error).__name__}: {error}")
        print(json.dumps(answer), flush=True)
