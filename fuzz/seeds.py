#!/usr/bin/env python3
"""Writes the hand-made part of the corpora: whole small files in every format, and nasty ones.

    fuzz/seeds.py ZOO [DATA]

ZOO is what `shapelex zoo --out ZOO` wrote: a piece of a creature is cut out of it. DATA is a data directory with an
index, from which records are taken; it is only needed when the format of the records changes. Needs Python 3.8, nothing
else.
"""
import base64
import gzip
import io
import json
import pathlib
import struct
import sys
import tarfile
import zipfile

CORPUS = pathlib.Path(__file__).parent / "corpus"


def put(target, name, data):
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"seed-{name}").write_bytes(data if isinstance(data, bytes) else data.encode())


def piece(zoo, faces_wanted=40):
    """A connected piece of the first creature: vertices and faces."""
    path = sorted(pathlib.Path(zoo).rglob("*.obj"))[0]
    vertices, faces = [], []
    for line in path.read_text().splitlines():
        words = line.split()
        if words and words[0] == "v":
            vertices.append(tuple(float(x) for x in words[1:4]))
        elif words and words[0] == "f":
            faces.append(tuple(int(w.split("/")[0]) - 1 for w in words[1:4]))
    kept, inside, grown = [faces[0]], set(faces[0]), True
    while grown and len(kept) < faces_wanted:
        grown = False
        for face in faces:
            if len(kept) < faces_wanted and face not in kept and inside & set(face):
                kept.append(face)
                inside |= set(face)
                grown = True
    order = sorted(inside)
    place = {v: i for i, v in enumerate(order)}
    return [tuple(round(x, 4) for x in vertices[v]) for v in order], [tuple(place[v] for v in f) for f in kept]


def obj(v, f):
    lines = ["mtllib none.mtl", "o piece"] + ["v %g %g %g" % p for p in v] + ["vt 0 0", "vn 0 0 1"]
    return "\n".join(lines + ["f %d/1/1 %d//1 %d" % tuple(k + 1 for k in t) for t in f]) + "\n"


def off(v, f):
    return "\n".join(["OFF", f"{len(v)} {len(f)} 0"] + ["%g %g %g" % p for p in v] + ["3 %d %d %d" % t for t in f])


def ply(v, f, kind):
    head = f"ply\nformat {kind} 1.0\ncomment piece\nelement vertex {len(v)}\nproperty float x\nproperty float y\n"
    head += f"property float z\nelement face {len(f)}\nproperty list uchar int vertex_indices\nend_header\n"
    if kind == "ascii":
        return head + "\n".join(["%g %g %g" % p for p in v] + ["3 %d %d %d" % t for t in f]) + "\n"
    order = "<" if kind == "binary_little_endian" else ">"
    body = b"".join(struct.pack(order + "3f", *p) for p in v)
    return head.encode() + body + b"".join(struct.pack(order + "B3i", 3, *t) for t in f)


def stl(v, f):
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *v[a], *v[b], *v[c], 0) for a, b, c in f)
    return b"piece".ljust(80) + struct.pack("<I", len(f)) + body


def stl_text(v, f):
    text = "solid piece\n"
    for t in f:
        text += "facet normal 0 0 1\nouter loop\n" + "".join("vertex %g %g %g\n" % v[k] for k in t)
        text += "endloop\nendfacet\n"
    return text + "endsolid piece\n"


class Gltf:
    """A document with one buffer."""

    def __init__(self, v, f):
        self.data = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                     "bufferViews": [], "accessors": []}
        position = self.add("VEC3", 5126, v, "f")
        index = self.add("SCALAR", 5123, [(k,) for t in f for k in t], "H")
        self.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": position}, "indices": index}]}]

    def add(self, kind, component, rows, code):
        data = b"".join(struct.pack(f"<{len(r)}{code}", *r) for r in rows)
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.json["bufferViews"].append(view)
        self.data += data
        accessor = {"bufferView": len(self.json["bufferViews"]) - 1, "componentType": component, "type": kind,
                    "count": len(rows)}
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def skinned(self, v):
        identity = (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)
        attributes = self.json["meshes"][0]["primitives"][0]["attributes"]
        attributes["JOINTS_0"] = self.add("VEC4", 5121, [(0, 1, 0, 0)] * len(v), "B")
        attributes["WEIGHTS_0"] = self.add("VEC4", 5126, [(0.5, 0.5, 0, 0)] * len(v), "f")
        matrices = self.add("MAT4", 5126, [identity, identity], "f")
        self.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": matrices}]
        self.json["nodes"] = [{"mesh": 0, "skin": 0}, {"children": [2], "rotation": [0, 0, 0, 1]},
                              {"translation": [0, 1, 0]}]
        self.json["scenes"] = [{"nodes": [0, 1]}]
        times = self.add("SCALAR", 5126, [(0,), (1,)], "f")
        turns = self.add("VEC4", 5126, [(0, 0, 0, 1), (0, 0.7, 0, 0.7)], "f")
        self.json["animations"] = [{"name": "turn", "samplers": [{"input": times, "output": turns}],
                                    "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}]}]
        return self

    def morphing(self, v):
        primitive = self.json["meshes"][0]["primitives"][0]
        primitive["targets"] = [{"POSITION": self.add("VEC3", 5126, [(0, 0, 1)] * len(v), "f")}]
        self.json["meshes"][0]["weights"] = [0.5]
        times = self.add("SCALAR", 5126, [(0,), (1,)], "f")
        weights = self.add("SCALAR", 5126, [(0,), (1,)], "f")
        self.json["animations"] = [{"samplers": [{"input": times, "output": weights, "interpolation": "STEP"}],
                                    "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]
        return self

    def sparse(self):
        index = self.add("SCALAR", 5123, [(1,)], "H")
        values = self.add("VEC3", 5126, [(9, 9, 9)], "f")
        views = [self.json["accessors"][k]["bufferView"] for k in (index, values)]
        self.json["accessors"][0]["sparse"] = {"count": 1, "indices": {"bufferView": views[0], "componentType": 5123},
                                               "values": {"bufferView": views[1]}}
        return self

    def text(self):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        return json.dumps({**self.json, "buffers": [{"byteLength": len(self.data), "uri": uri}]},
                          separators=(",", ":"))

    def glb(self):
        text = json.dumps({**self.json, "buffers": [{"byteLength": len(self.data)}]}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + b"\0" * (-len(self.data) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
        return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data


def meshes(zoo):
    v, f = piece(zoo)
    tetra = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
    put("mesh_obj", "piece", obj(v, f))
    put("mesh_obj", "quads", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf -5 -4 -3 -2 \\\n -1\nf 1 2 5\nl 1 2\ns off\n")
    put("mesh_obj", "numbers", "v 1e75 -1e-300 0x1\nv nan inf -0\nv 1 1 1 0.5 0.5 0.5\nf 1 2 3\nf 9999999999 0 -9\n")
    put("mesh_obj", "latin", b"o \xe9\xff\nv 0 0 0\r\nv 1 0 0\rv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    put("mesh_off", "piece", off(v, f))
    put("mesh_off", "colour", "COFF # c\n4 2 0\n0 0 0 255 0 0 1\n1 0 0 0 0 0 1\n0 1 0 0 0 0 1\n0 0 1 0 0 0 1\n3 0 1 2 1 0 0\n4 0 1 2 3\n")
    put("mesh_off", "promise", "OFF\n4000000000 4000000000 0\n0 0 0\n")
    put("mesh_off", "polygon", "OFF 3 1 0 0 0 0 1 0 0 0 1 0 2000000000 0 1 2")
    put("mesh_ply", "ascii", ply(v, f, "ascii"))
    put("mesh_ply", "little", ply(v, f, "binary_little_endian"))
    put("mesh_ply", "big", ply(*tetra, "binary_big_endian"))
    put("mesh_ply", "extra", "ply\nformat ascii 1.0\nobj_info x\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty list uchar float q\nelement edge 1\nproperty int a\nelement face 2\nproperty uchar r\nproperty list uint16 uint32 vertex_index\nend_header\n0 0 0 0\n1 0 0 1 5\n0 1 0 0\n0 0 1 0\n7\n9 3 0 1 2\n9 4 0 1 2 3\n")
    put("mesh_ply", "promise", "ply\nformat binary_little_endian 1.0\nelement vertex 90000000\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uint int vertex_index\nend_header\n")
    put("mesh_stl", "binary", stl(v, f))
    put("mesh_stl", "text", stl_text(*tetra))
    put("mesh_stl", "solid", stl(*tetra).replace(b"piece", b"solid"))
    put("mesh_stl", "promise", b" " * 80 + struct.pack("<I", 50_000_000) + b"\0" * 500)
    for target, write in (("mesh_gltf", Gltf.text), ("mesh_glb", Gltf.glb)):
        put(target, "piece", write(Gltf(v, f)))
        put(target, "skinned", write(Gltf(*tetra).skinned(tetra[0])))
        put(target, "morphing", write(Gltf(*tetra).morphing(tetra[0])))
        put(target, "sparse", write(Gltf(*tetra).sparse()))
        circle = Gltf(*tetra)
        circle.json["nodes"] = [{"mesh": 0, "children": [1]}, {"children": [0]}]
        put(target, "circle", write(circle))
        strip = Gltf(*tetra)
        strip.json["meshes"][0]["primitives"][0]["mode"] = 5
        strip.json["nodes"][0]["matrix"] = [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 1, 1, 1, 1]
        put(target, "strip", write(strip))
    # Streams of Draco and meshoptimizer; how they were made is beside the cases.
    for path in sorted((CORPUS.parents[1] / "tests/data/mesh/cases/gltf").glob("*.glb")):
        if path.name.startswith(("draco_", "meshopt_")):
            put("mesh_glb", path.stem.replace("_", "-"), path.read_bytes())
    for target in ("obj", "gltf", "glb", "ply", "stl", "off"):
        for seed in sorted((CORPUS / f"mesh_{target}").glob("seed-*")):
            put("mesh_detect", f"{target}-{seed.name[5:]}", seed.read_bytes())


def cases():
    """The handed files of tests/data, and polygons: a byte that tilts them, then corners of two bytes."""
    for path in sorted((CORPUS.parent.parent / "tests/data/mesh/cases").rglob("*.*")):
        if path.stat().st_size < 20_000:
            put(f"mesh_{path.suffix[1:]}", f"case-{path.stem}", path.read_bytes())
    put("mesh_stl", "case-two-files", 2 * stl([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)] * 9))
    put("mesh_stl", "case-words", "SOLID a\ncolor 1 2 3\nfacet normal nan -nan(ind) 1.#INF outer loop vertex 0 0 0 vertex 1 0 0\n"
        "vertex 1 1 0 vertex 0 1 0 end loop end facet facet vertex 0 0 0 vertex 1 0 0 vertex 0 0 1 end solidname\n")
    put("mesh_off", "case-stream", "STCN4nOFF 3 4\n2 0 0 0 1 " + "0 " * 9 + "1 0 0 2 " + "0 " * 9 + "0 1 0 1 " + "0 " * 9
        + "0 0 1 1 " + "0 " * 9 + "3 0 1 2 4 0 1 2 3")
    put("mesh_ply", "case-rows", "ply\nformat ascii 1.0\nelement vertex 2\nproperty int64 x\nproperty uint64 y\nproperty float z\n"
        "element vertex 2\nproperty float z\nproperty float x\nproperty float x\nproperty float y\nelement tristrips 1\n"
        "property list char int vertex_Index\nend_header \n0 0\n0\n1 0 0 9\n0 0 9 1\n1 0 0 0\n6 0 1 2 -1 1\n3\n")
    comb = bytes(b for k in range(0, 250, 2) for b in (k, 1, k + 1, 250)) + bytes((250, 1, 250, 0, 0, 0))
    spiral = [(0, 0), (9, 0), (9, 9), (2, 9), (2, 4), (5, 4), (5, 5), (3, 5), (3, 8), (8, 8), (8, 1), (1, 1), (1, 9), (0, 9)]
    ring = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0), (2, 2), (2, 7), (7, 7), (7, 2), (2, 2)]
    shapes = {"l": [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], "dart": [(0, 0), (2, 1), (0, 2), (1, 1)],
              "star": [(5, 0), (2, 9), (9, 3), (0, 3), (7, 9)], "spiral": spiral, "ring": ring,
              "straight": [(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (0, 2), (0, 1)], "spike": [(0, 0), (9, 0), (4, 0), (4, 4)]}
    for name, points in shapes.items():
        put("mesh_polygon", name, bytes((0, *(c for p in points for c in p))))
        put("mesh_polygon", name + "-back", bytes((0x35, *(c for p in points[::-1] for c in p))))
    put("mesh_polygon", "comb", b"\x21" + comb)
    put("mesh_polygon", "comb-crossed", b"\x21" + comb + comb[:99])


def zip_of(files, method=zipfile.ZIP_DEFLATED):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        for name, data in files:
            archive.writestr(zipfile.ZipInfo(name), data, compress_type=method)
    return out.getvalue()


def tar_of(files):
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w", format=tarfile.GNU_FORMAT) as archive:
        for name, data in files:
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    # Without the padding to a whole record.
    return out.getvalue()[: 1024 * (len(files) + 1) + sum(-(-len(d) // 512) * 512 for _, d in files)]


def archives():
    files = [("a/one.off", b"OFF 1 2 3"), ("__MACOSX/._x", b"x"), ("./two.obj", b"v 0 0 0\n" * 20)]
    put("archive", "zip", zip_of(files))
    put("archive", "stored", zip_of(files, zipfile.ZIP_STORED))
    put("archive", "tar", tar_of(files))
    put("archive", "targz", gzip.compress(tar_of(files), mtime=0))
    put("archive", "two-members", gzip.compress(b"x", mtime=0) + gzip.compress(tar_of(files), mtime=0))
    put("archive", "up", zip_of([("../x.off", b"OFF"), ("C:\\x.off", b"OFF"), ("a\\..\\..\\b", b"")]))
    put("archive", "tar-up", tar_of([("a/../../x.off", b"OFF"), ("/etc/x.off", b"OFF")]))
    put("archive", "long-name", tar_of([("d/" * 120 + "x.off", b"OFF")]))
    put("archive", "bomb", zip_of([("bomb.off", b"0" * 200_000)]))
    put("archive", "gz-bomb", gzip.compress(tar_of([("bomb.off", b"0" * 200_000)]), mtime=0))
    put("archive", "nested", zip_of([("inner.zip", zip_of(files))]))
    put("archive", "empty", zip_of([]))


def requests():
    cases = {
        "query": b"\0top=3&rank_by=trimmed_objective&name=dog.obj",
        "query-odd": b"\0top=-1&top=2&rank_by=luck&name=%FF%00+",
        "upload": b"\1create=true&poses=4&name=a%2Fb.glb",
        "page": b"\2limit=10&cursor=MDE5MA",
        "page-odd": b"\3limit=1001&cursor=%3D%3D%3D",
        "create": b'\4{"name": "dog"}',
        "deep": b'\4{"name": ' + b"[" * 200 + b"]" * 200 + b"}",
        "rename": b'\5{"name": "\\u0000\\ud800"}',
        "list": b"\5[1]",
        "reindex": json.dumps({"scope": {"classes": ["a"]}, "preset": "paper"}).encode(),
        "parameters": json.dumps({"scope": "all", "parameters": {"atoms": 64, "lambda": 0.25, "components": "all",
                                  "range": {"fixed": {"low": 1.0, "high": 8.0}}, "hypotheses": ["plain", "doubled"],
                                  "per_shape": True, "seed": 18446744073709551615}}).encode(),
        "huge": b'{"parameters": {"eigenpairs": 1e999, "lambda": 1e-320, "atoms": 99999999999999999999}}',
    }
    for name, data in cases.items():
        put("request", name, data if data[0] < 8 else b"\6" + data)


def records(data):
    """Payloads out of a data directory, each behind the number `store::fuzzing` gives its family."""
    number = {2: 3, 3: 2, 5: 2, 6: 2, 7: 2, 11: 2, 4: 4, 8: 6, 9: 7, 10: 8, 12: 5}
    seen = {}
    for path in sorted(p for p in pathlib.Path(data).rglob("*") if p.is_file()):
        raw = path.read_bytes()
        at = raw.find(b"SLX")
        while at >= 0 and at + 14 <= len(raw):
            family, version, length = struct.unpack("<BHI", raw[at + 3:at + 10])
            payload = raw[at + 14:at + 14 + length]
            kind = number.get(family, 0 if length == 8 else 1)
            if len(payload) == length and 0 < length < 50_000 and 1 <= family <= 12 and version == 1:
                if seen.setdefault(kind, 0) < 2:
                    put("record", f"{kind}-{seen[kind]}", bytes([kind, version]) + payload)
                    seen[kind] += 1
                if seen.setdefault("envelope", 0) < 3 and length < 200:
                    put("record", f"envelope-{seen['envelope']}", raw[at:at + 14 + length])
                    seen["envelope"] += 1
            at = raw.find(b"SLX", at + 1)
        if path.name.startswith("catalogue"):
            for k, line in enumerate(raw.splitlines(keepends=True)[:6]):
                put("record", f"line-{k}", line)
                put("record", f"event-{k}", b"\x09\x01" + line[9:])


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    cases()
    meshes(sys.argv[1])
    archives()
    requests()
    if len(sys.argv) > 2:
        records(sys.argv[2])
    print("\n".join(f"{d.name}: {len(list(d.iterdir()))}" for d in sorted(CORPUS.iterdir())))
