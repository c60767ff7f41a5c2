"""shapelex and its Python peers on the same inputs, in turn, in one run.

Every row is measured in rounds: ours, theirs, ours, theirs, ... so that a change in the machine's speed meets both.
The ratio is the median of the rounds' ratios, with its quartiles; `agree` says whether the answers are the same.
"""

import argparse
import itertools
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent


# A query codes its signals under one class after the other, this many in the rows of the query.
CALLS = 12


class Process:
    """A worker that answers one JSON line per JSON line."""

    def __init__(self, command, threads):
        environment = dict(os.environ, RAYON_NUM_THREADS=str(threads))
        for name in ("OPENBLAS", "OMP", "MKL"):
            environment[name + "_NUM_THREADS"] = str(threads)
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )

    def __call__(self, **command):
        self.process.stdin.write(json.dumps(command) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"a worker ended during {command}")
        answer = json.loads(line)
        if "error" in answer:
            raise SystemExit(f"{command}: {answer['error']}")
        return answer


def rested(side):
    """Runs one side once the other's idle threads have stopped spinning for work."""
    time.sleep(0.05)
    return side()


class Table:
    def __init__(self, most_rounds):
        self.rows = {}
        self.most_rounds = most_rounds

    def measure(self, name, rounds, ours, theirs, agree):
        pairs = []
        for _ in range(int(min(rounds, self.most_rounds))):
            pairs.append(tuple(rested(side) for side in (ours, theirs)))
        ratios = [b["ms"] / a["ms"] for a, b in pairs]
        quartiles = statistics.quantiles(ratios, n=4) if len(ratios) > 1 else [ratios[0]] * 3
        self.rows[name] = {
            "ours_ms": round(statistics.median(a["ms"] for a, _ in pairs), 3),
            "peer_ms": round(statistics.median(b["ms"] for _, b in pairs), 3),
            "ratio": round(statistics.median(ratios), 2),
            "quartiles": [round(quartiles[0], 2), round(quartiles[2], 2)],
            "ours_mb": round(statistics.median(a["mb"] for a, _ in pairs)),
            "peer_mb": round(statistics.median(b["mb"] for _, b in pairs)),
            "agree": bool(agree(*pairs[-1])),
        }
        row = self.rows[name]
        print(
            f"{name:58} {row['ours_ms']:10.2f} {row['peer_ms']:10.2f} {row['ratio']:8.2f} "
            f"({row['quartiles'][0]:.2f}-{row['quartiles'][1]:.2f}) {row['ours_mb']:6} {row['peer_mb']:6}  "
            f"{'yes' if row['agree'] else 'NO'}",
            flush=True,
        )


def creatures(shapelex, directory, classes, poses):
    """A folder per class of procedural creatures, as lists of paths by class."""
    subprocess.run(
        [shapelex, "zoo", "--out", directory, "--classes", str(classes), "--poses", str(poses)],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )
    return {d.name: sorted(map(str, d.glob("*.obj"))) for d in sorted(Path(directory).iterdir()) if d.is_dir()}


def subdivide(source, target, times):
    """Every face into four, `times` times, with a little of each new vertex's neighbourhood smoothed in."""
    vertices, faces = [], []
    for line in open(source):
        part = line.split()
        if part[:1] == ["v"]:
            vertices.append([float(x) for x in part[1:4]])
        elif part[:1] == ["f"]:
            faces.append([int(x.split("/")[0]) - 1 for x in part[1:4]])
    for _ in range(times):
        middle, finer = {}, []

        def between(a, b):
            key = (min(a, b), max(a, b))
            if key not in middle:
                middle[key] = len(vertices)
                vertices.append([(p + q) / 2 for p, q in zip(vertices[a], vertices[b])])
            return middle[key]

        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            finer += [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        faces = finer
    with open(target, "w") as out:
        out.write("".join(f"v {x:.7f} {y:.7f} {z:.7f}\n" for x, y, z in vertices))
        out.write("".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces))
    return len(vertices)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ours", required=True)
    parser.add_argument("--shapelex", required=True)
    parser.add_argument("--quick", action="store_true", help="smaller inputs and fewer rounds, under 5 minutes")
    parser.add_argument("--smoke", action="store_true", help="every row once on tiny inputs; fails where answers differ")
    parser.add_argument("--json", action="store_true", help="the last line is one object of all rows")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--rows", default="eigen,lasso,learn,query,reindex,read")
    options = parser.parse_args()
    if options.smoke:
        options.quick, options.threads = True, "1"
    wanted = options.rows.split(",")
    table = Table(1 if options.smoke else math.inf)
    print(f"{'':58} {'ours ms':>10} {'peer ms':>10} {'ratio':>8} (quartiles) {'MB':>6} {'peer':>6}  agree")
    with tempfile.TemporaryDirectory() as scratch:
        scratch = Path(scratch)
        classes, poses = (3, 3) if options.smoke else (12, 5 if options.quick else 13)
        zoo = creatures(options.shapelex, scratch / "zoo", classes, poses)
        for threads in map(int, options.threads.split(",")):
            # Memory is that of a process, so every kind of work has processes of its own.
            ours = lambda: Process([options.ours], threads)
            peer = lambda: Process([sys.executable, str(HERE / "peer.py"), str(threads)], threads)
            label = f"{threads} thread{'s' if threads > 1 else ''}"
            if "eigen" in wanted:
                eigen(table, ours, peer, zoo, scratch, label, options)
            if "lasso" in wanted or "learn" in wanted:
                coding(table, ours, peer, zoo, scratch, label, options, wanted, threads)
            if "query" in wanted or "reindex" in wanted:
                whole(table, ours, peer, zoo, scratch, label, options, wanted, threads)
            if "read" in wanted and threads == 1:
                reading(table, ours(), peer(), zoo, scratch, options)
    if options.json:
        print(json.dumps(table.rows))
    differ = [name for name, row in table.rows.items() if not row["agree"]]
    if differ:
        raise SystemExit(f"the two sides differ in {len(differ)} of {len(table.rows)} rows: {'; '.join(differ)}")
    if options.smoke:
        print(f"{len(table.rows)} rows ran, and both sides agree in all of them")


def torus(target, around, along):
    """A bumpy closed surface of around × along vertices without symmetry, in shuffled order."""
    count = around * along
    place = lambda i, j: (((i % along) * around + j % around) * 7919 + 13) % count
    vertices, faces = [None] * count, []
    for i in range(along):
        for j in range(around):
            u, v = 2 * math.pi * i / along, 2 * math.pi * (j + 0.3 * math.sin(3.7 * i)) / around
            r = 0.4 + 0.08 * math.sin(3 * u + 1) * math.cos(2 * v) + 0.05 * math.cos(5 * u - v)
            ring = 1 + 0.15 * math.sin(2 * u - 0.5)
            x, y = (ring + r * math.cos(v)) * math.cos(u), (ring + r * math.cos(v)) * math.sin(u)
            vertices[place(i, j)] = (1.3 * x, y, r * math.sin(v) + 0.1 * math.sin(u))
            a, b, c, d = place(i, j), place(i + 1, j), place(i + 1, j + 1), place(i, j + 1)
            faces += [(a, b, c), (a, c, d)]
    with open(target, "w") as out:
        out.write("".join("v %.9f %.9f %.9f\n" % p for p in vertices))
        out.write("".join("f %d %d %d\n" % tuple(k + 1 for k in f) for f in faces))


def eigen(table, ours, peer, zoo, scratch, label, options):
    quick = options.quick
    first = next(iter(zoo.values()))[0]
    inputs = [("zoo", first)]
    for times in () if options.smoke else (1, 2):  # About 9k and 35k vertices.
        finer = scratch / f"finer{times}.obj"
        if not finer.exists():
            subdivide(first, finer, times)
        inputs.append(("zoo, subdivided", str(finer)))
    for around, along in () if quick else ((30, 50), (50, 100), (100, 200), (250, 400)):
        mesh = scratch / f"torus{along}.obj"
        if not mesh.exists():
            torus(mesh, around, along)
        inputs.append(("torus", str(mesh)))
    for path in () if options.smoke else ("tosca_lowres/cat/cat0.off", "sumner/cat/cat-reference.obj"):
        real = ROOT.parent / "shared" / "data" / path
        if real.exists():
            inputs.append((path, str(real)))
        else:
            print(f"skipped: {path}: not there")
    for name, mesh in inputs:
        a, b = ours(), peer()
        size = a(op="operators", mesh=mesh, out=str(scratch))["vertices"]
        b(op="operators", dir=str(scratch))
        rounds = 1 if size > (20_000 if quick else 50_000) else 3 if size > 10_000 or quick else 5
        table.measure(
            f"200 eigenpairs, {size} vertices ({name}), {label}", rounds,
            lambda: a(op="eigen", n=200, values=str(scratch / "ours")),
            lambda: b(op="eigen", n=200, values=str(scratch / "theirs")),
            lambda *_: b(op="close", a=str(scratch / "ours"), b=str(scratch / "theirs"))["relative"] < 1e-6,
        )


def coding(table, ours, peer, zoo, scratch, label, options, wanted, threads):
    quick = options.quick
    class_meshes = next(iter(zoo.values()))
    describing, judging = ours(), peer()
    for preset, normalisation in (("default", "sqrt_unit"), ("paper", "unit"), ("paper", "raw")):
        parameters = describing(op="setup", preset=preset)["parameters"]
        atoms, batch = parameters["atoms"], parameters["batch"]
        parts = []
        for i, mesh in enumerate(class_meshes[:5]):
            path = scratch / f"signals{i}"
            # A query is coded at every vertex, a training shape at the preset's sample.
            whole = {"samples": 0} if i == len(class_meshes[:5]) - 1 else {}
            describe = dict(mesh=mesh, preset=preset, normalisation=normalisation, signals=str(path), **whole)
            rows, _ = describing(op="describe", **describe)["shape"]
            parts.append(path)
        held_out = scratch / "held_out"
        held_out.write_bytes(parts[-1].read_bytes()[: 1500 * rows * 8])
        training = scratch / "training"
        training.write_bytes(b"".join(p.read_bytes() for p in parts[:-1]))
        setup = dict(signals=str(training), rows=rows, atoms=atoms, batch=batch)
        name = f"{preset} preset, {normalisation}"
        # Both sides learn a class on one thread; classes are what runs in parallel.
        if normalisation != "raw" and "learn" in wanted and threads == 1:
            judge = lambda d: judging(op="objective", signals=str(held_out), dictionary=d, rows=rows, parameter=0.5)["objective"]
            a, b = ours(), peer()
            learn = lambda k: a(op="learn", **setup, **{"lambda": 0.5}, iterations=k, dictionary=str(scratch / "d_ours"))
            theirs = lambda: b(op="learn", **setup, parameter=0.5, iterations=25, dictionary=str(scratch / "d_theirs"))
            # As many mini-batches of ours as it takes to the objective on held-out signals that the peer has after 25.
            theirs()
            reached = judge(str(scratch / "d_theirs"))
            for batches in (5, 10, 15, 20, 25):
                learn(batches)
                if judge(str(scratch / "d_ours")) <= reached:
                    break
            table.measure(
                f"learning, {name}, {batches} mini-batches against 25, {label}", 2 if quick else 4,
                lambda: learn(batches),
                theirs,
                lambda a, b: judge(str(scratch / "d_ours")) <= judge(str(scratch / "d_theirs")) * (1 + 1e-4),
            )
        judging(op="learn", **setup, parameter=0.5, iterations=25, dictionary=str(scratch / "d"))
        files = dict(signals=str(held_out), dictionary=str(scratch / "d"), rows=rows)
        calls = 1 if options.smoke else CALLS
        a, b = ours(), peer()
        a(op="dictionary", **files)
        b(op="dictionary", **files)
        for parameter in (0.5, 0.05) if "lasso" in wanted else ():
            table.measure(
                f"Lasso of 1500 signals, {name}, lambda {parameter}, {label}", 3 if quick else 7,
                lambda: a(op="lasso", calls=calls, **{"lambda": parameter}),
                lambda: b(op="lasso", calls=calls, parameter=parameter),
                lambda a, b: abs(a["objective"] - b["objective"]) <= 1e-6 * b["objective"],
            )


def whole(table, ours, peer, zoo, scratch, label, options, wanted, threads):
    quick = options.quick
    held_out = {name: meshes[-1] for name, meshes in zoo.items()}
    classes = [dict(label=name, meshes=meshes[:-1]) for name, meshes in zoo.items()]
    for preset in ("default", "paper"):
        if "query" not in wanted and preset == "paper":
            continue
        directory = scratch / f"index-{preset}"
        directory.mkdir(exist_ok=True)
        poses = len(classes[0]["meshes"])
        learner = ours()
        # The peer works with the parameters that ours uses, whatever the presets are.
        setup = {k: v for k, v in learner(op="setup", preset=preset).items() if k != "mb"}
        if preset == "default" and "reindex" in wanted:
            # As many processes as threads, of one thread each.
            other = Process([sys.executable, str(HERE / "peer.py"), str(threads)], 1)
            table.measure(
                f"whole reindex, {len(classes)} classes x {poses} shapes, {preset} preset, {label} against as many processes", 1,
                lambda: learner(op="index", preset=preset, classes=classes, out=str(directory)),
                lambda: other(op="index", setup=setup, classes=classes),
                lambda a, b: True,
            )
        else:
            learner(op="index", preset=preset, classes=classes, out=str(directory))
        if "query" not in wanted:
            continue
        a, b = ours(), peer()
        a(op="load", preset=preset, dir=str(directory))
        b(op="load", setup=setup, dir=str(directory))
        meshes = itertools.cycle(held_out.values())
        asked = {}

        def ask_ours():
            asked["mesh"] = next(meshes)
            answer = a(op="query", mesh=asked["mesh"])
            asked["vertices"] = answer["vertices"]
            return answer

        table.measure(
            f"whole query, {len(classes)} classes, {preset} preset, {label}", 4 if quick else 12,
            ask_ours,
            # The same mesh, and the signatures of the same vertices.
            lambda: b(op="query", **asked),
            lambda a, b: a["best"] == b["best"] and abs(a["score"] - b["score"]) < 1e-4 * b["score"],
        )


def reading(table, ours, peer, zoo, scratch, options):
    quick = options.quick
    big = scratch / "big.obj"
    subdivide(next(iter(zoo.values()))[0], big, 1 if options.smoke else 4)  # A million faces.
    peer(op="convert", mesh=str(big), out=str(scratch))
    for kind in ("obj", "ply", "glb"):
        mesh = str(scratch / f"big.{kind}")
        for clean in (False, True):
            work = dict(op="read", mesh=mesh, clean=clean)
            faces = ours(**work)["faces"]
            table.measure(
                f"{'clean mesh from' if clean else 'read'} {kind.upper()} of {faces} faces", 1 if quick else 4,
                lambda: ours(**work),
                lambda: peer(**work),
                lambda a, b: a["faces"] == b["faces"],
            )


if __name__ == "__main__":
    started = time.time()
    main()
    print(f"{time.time() - started:.0f} s in all", file=sys.stderr)
