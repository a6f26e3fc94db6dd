"""Attempts on models, units and surfaces: what another tool, another unit or a typing mistake makes of right inputs."""

import h5py
import numpy as np

from scene import hill_scan


def read_matrix(path):
    table = np.loadtxt(path)
    return table[:, :2].astype(int), table[:, 2]


def write_matrix(scene, name, places, values):
    scene.write(name, "\n".join(f"{i} {j} {value:.15e}" for (i, j), value in zip(places, values)) + "\n")


def dense(places, values):
    n = places.max()
    full = np.zeros((n, n))
    full[places[:, 0] - 1, places[:, 1] - 1] = values
    full[places[:, 1] - 1, places[:, 0] - 1] = values
    return full


def sparse(full, upper=True):
    rows, columns = np.nonzero(np.triu(full) if upper else np.tril(full))
    return np.column_stack([rows, columns]) + 1, full[rows, columns]


def node_lines(scene):
    """Lines of the mesh: before the nodes, node lines, after."""
    lines = (scene.folder / "mesh.inp").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.upper().startswith("*NODE")) + 1
    last = next(k for k in range(first, len(lines)) if lines[k].startswith("*"))
    return lines[:first], lines[first:last], lines[last:]


def put_nodes(scene, before, nodes, after):
    scene.write("mesh.inp", "\n".join([*before, *nodes, *after]) + "\n")


def renumbered(scene, rng):
    """Labels of the mesh permuted, the matrices left."""
    before, nodes, after = node_lines(scene)
    labels = [line.split(",")[0].strip() for line in nodes]
    way = rng.choice(["swap two", "reverse", "shuffle", "shift", "block"])
    new = list(labels)
    if way == "swap two":
        i, j = rng.sample(range(len(new)), 2)
        new[i], new[j] = new[j], new[i]
    elif way == "reverse":
        new.reverse()
    elif way == "shuffle":
        rng.shuffle(new)
    elif way == "shift":
        k = rng.randrange(1, len(new))
        new = new[k:] + new[:k]
    else:
        start = rng.randrange(len(new) - 8)
        part = new[start:start + 8]
        rng.shuffle(part)
        new[start:start + 8] = part
    # The mesh keeps its shape: labels change everywhere, as an export by another tool does it.
    change = dict(zip(labels, new))
    nodes = [change[line.split(",")[0].strip()] + line[line.index(","):] for line in nodes]

    def relabel(lines):
        card, out = "", []
        for line in lines:
            if line.startswith("*"):
                card = line.upper()
                out.append(line)
            elif card.startswith("*ELEMENT"):
                fields = [field.strip() for field in line.split(",")]
                out.append(", ".join([fields[0], *(change.get(field, field) for field in fields[1:])]))
            elif card.startswith("*NSET"):
                out.append(", ".join(change.get(field.strip(), field.strip()) for field in line.split(",")))
            else:
                out.append(line)
        return out
    put_nodes(scene, before, nodes, relabel(after))
    scene.write("sets.inp", "\n".join(relabel((scene.folder / "sets.inp").read_text().splitlines())) + "\n")
    if change != dict(zip(labels, labels)):
        scene.not_in_silence("block.nml", "out.h5", f"labels: {way}", severity=3)


def inner_rows(scene):
    """Rows (from 1) of nodes away from supports and springs: there one wrong entry can be told."""
    rows = [tuple(map(int, line.split("."))) for line in (scene.folder / "m.dof").read_text().split()]
    _, _, after = node_lines(scene)
    elements = [[int(x) for x in line.split(",")[1:]] for line in after if line.count(",") == 8]
    deck = (scene.folder / "m.inp").read_text().upper().split("*")
    held = {int(line.split(",")[1]) for card in deck if "SPRING1" in card for line in card.splitlines()[1:] if "," in line}
    free = {node for node in {n for e in elements for n in e} if all((node, c) in rows for c in (1, 2, 3))} - held
    inner = {node for node in free if all(n in free for e in elements if node in e for n in e)}
    return {k + 1 for k, (node, _) in enumerate(rows) if node in inner}


def matrices(scene, rng):
    """Matrices of which something is gone, doubled, exchanged or rotated."""
    way = rng.choice(["lower only", "diagonal doubled", "K and M", "one entry", "entry lost", "sign", "rotated", "mass scaled",
                      "row scaled", "cut", "both triangles", "mass of one direction"])
    name = rng.choice(["m.sti", "m.mas"]) if way in ("diagonal doubled", "cut") else "m.sti"
    places, values = read_matrix(scene.folder / name)
    inner = np.isin(places, list(inner_rows(scene))).all(axis=1)
    # Between rows of one direction a wrong entry looks like springs to the ground at both nodes.
    direction = np.array([int(line.split(".")[1]) for line in (scene.folder / "m.dof").read_text().split()])[places - 1]
    off = np.flatnonzero((direction[:, 0] != direction[:, 1]) & inner & (np.abs(values) > 1e-2 * np.abs(values).max()))
    if way == "lower only":
        full = dense(places, values)
        keep = np.triu(full) + 0.0
        places, values = sparse(keep * (np.eye(len(full)) + rng.choice([0.0, 0.5]) * (1 - np.eye(len(full)))))
    elif way == "diagonal doubled":
        values = np.where(places[:, 0] == places[:, 1], 2 * values, values)
    elif way == "K and M":
        other = (scene.folder / "m.mas").read_text()
        scene.write("m.mas", (scene.folder / "m.sti").read_text())
        scene.write("m.sti", other)
        return scene.not_in_silence("block.nml", "out.h5", way, severity=3)
    elif way == "one entry":
        k = rng.choice(list(off))
        values = values.copy()
        values[k] *= 1.5
    elif way == "entry lost":
        k = rng.choice(list(off))
        places, values = np.delete(places, k, axis=0), np.delete(values, k)
    elif way == "sign":
        k = rng.choice(list(off))
        values = values.copy()
        values[k] = -values[k]
    elif way == "mass scaled":
        places, values = read_matrix(scene.folder / "m.mas")
        name, values = "m.mas", values * rng.choice([1e3, 1e-3, 1e12, 1e-12, 9.81])
    elif way == "row scaled":
        full = dense(places, values)
        k = rng.choice(sorted(inner_rows(scene))) - 1
        full[k] *= 1.1
        full[:, k] *= 1.1
        places, values = sparse(full)
    elif way == "cut":
        places, values = places[:-rng.choice([1, 10, 200])], values[:-rng.choice([1, 10, 200])]
        values = values[:len(places)]
        places = places[:len(values)]
    elif way == "both triangles":
        full = dense(places, values)
        rows, columns = np.nonzero(full)
        places, values = np.column_stack([rows, columns]) + 1, full[rows, columns]
    elif way == "mass of one direction":
        places, values = read_matrix(scene.folder / "m.mas")
        name = "m.mas"
        component = np.array([int(line.split(".")[1]) for line in (scene.folder / "m.dof").read_text().split()])
        values = np.where(component[places[:, 0] - 1] == rng.choice([1, 2, 3]), 2 * values, values)
    else:
        # Nodal frames: all nodes, some, or one
        dofs = [line.split(".") for line in (scene.folder / "m.dof").read_text().split()]
        index = {(int(node), int(component)): k for k, (node, component) in enumerate(dofs)}
        whole = sorted({node for node, _ in index if all((node, c) in index for c in (1, 2, 3))})
        chosen = rng.choice([whole, [rng.choice(whole)], rng.sample(whole, len(whole) // 2)])
        angle, axis = rng.choice([30.0, 90.0, 45.0, 180.0, 5.0]), rng.choice([0, 1, 2])
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        a, b = [(1, 2), (2, 0), (0, 1)][axis]
        rotation = np.eye(3)
        rotation[[a, a, b, b], [a, b, a, b]] = [c, -s, s, c]
        for file in ("m.sti", "m.mas"):
            full = dense(*read_matrix(scene.folder / file))
            turn = np.eye(len(full))
            for node in chosen:
                rows = [index[node, k] for k in (1, 2, 3)]
                turn[np.ix_(rows, rows)] = rotation
            full = turn.T @ full @ turn
            full[np.abs(full) < 1e-14 * np.abs(full).max()] = 0
            write_matrix(scene, file, *sparse(full))
        return scene.not_in_silence("block.nml", "out.h5", f"{len(chosen)} frames turned by {angle} about {axis}", severity=3)
    write_matrix(scene, name, places, values)
    return scene.not_in_silence("block.nml", "out.h5", f"{name}: {way}", severity=3)


def decks(scene, rng):
    """Cards that move nodes, lines that are lost, coordinates that are exchanged."""
    before, nodes, after = node_lines(scene)
    way = rng.choice(["system", "instance", "line lost", "exchanged", "scaled", "two columns", "moved", "element lost", "cylindrical",
                      "nan", "twice"])
    if way == "system":
        before = before[:-1] + ["*SYSTEM", "0, 0, 5, 0, 1, 5, -1, 0, 5"] + before[-1:]
    elif way == "instance":
        before = ["*PART, NAME=P", *before]
        after = [*after, "*END PART", "*ASSEMBLY, NAME=A", "*INSTANCE, NAME=I, PART=P", "10., 0., 3.",
                 *rng.choice([[], ["10., 0., 3., 10., 0., 4., 90."]]), "*END INSTANCE", "*END ASSEMBLY"]
    elif way == "line lost":
        del nodes[rng.randrange(len(nodes))]
    elif way == "exchanged":
        turned = []
        for line in nodes:
            f = [field.strip() for field in line.split(",")]
            turned.append(", ".join([f[0], f[2], f[1], f[3]]))
        nodes = turned
    elif way == "scaled":
        factor = rng.choice([1e-3, 1e3, 25.4, 1 / 25.4])
        nodes = [", ".join([line.split(",")[0], *(repr(float(x) * factor) for x in line.split(",")[1:4])]) for line in nodes]
    elif way == "two columns":
        nodes = [",".join(line.split(",")[:3]) for line in nodes]
    elif way == "moved":
        k = rng.randrange(len(nodes))
        f = nodes[k].split(",")
        nodes[k] = ",".join([f[0], f[1], f[2], repr(float(f[3]) + rng.choice([0.5, 3.0, 30.0]))])
    elif way == "element lost":
        rows = [k for k, line in enumerate(after) if line[:1].isdigit()]
        del after[rng.choice(rows)]
    elif way == "cylindrical":
        before[-1] += ", SYSTEM=C"
    elif way == "nan":
        k = rng.randrange(len(nodes))
        nodes[k] = nodes[k].split(",")[0] + rng.choice([", nan, 0, 0", ", 1e400, 0, 0", ", 1,0 , 0, 0, 0"])
    else:
        nodes.append(nodes[rng.randrange(len(nodes))])
    put_nodes(scene, before, nodes, after)
    scene.not_in_silence("block.nml", "out.h5", f"deck: {way}")


def units(scene, rng):
    """Units that are missing or others than meant."""
    way = rng.choice(["no units", "no length", "no mass", "kg", "um", "force in kN", "friction in %", "E in MPa", "E in GPa",
                      "duration in ms", "amplitude", "damping in %", "model in mm"])
    case = "block.nml"
    if way == "no units":
        scene.edit(case, ", unit_length='mm', unit_mass='t', unit_time='s'", "")
    elif way == "no length":
        scene.edit(case, "unit_length='mm', ", "")
    elif way == "no mass":
        scene.edit(case, "unit_mass='t', ", "")
    elif way == "kg":
        scene.edit(case, "unit_mass='t'", "unit_mass='kg'")
    elif way == "um":
        scene.edit(case, "unit_length='mm'", "unit_length='um'")
    elif way == "force in kN":
        scene.edit(case, "interface_force=1000.0", "interface_force=1e9")
    elif way == "friction in %":
        scene.edit(case, "friction=0.5", f"friction={rng.choice([30, 50.0, 15])}")
    elif way in ("E in MPa", "E in GPa"):
        case = "scan.nml"
        scene.edit(case, "young_modulus=200e9", "young_modulus=" + {"E in MPa": "200e3", "E in GPa": "200"}[way])
    elif way == "duration in ms":
        case = "kick.nml"
        scene.edit(case, "duration=2.0e-3", "duration=2.0")
        outcome = scene.run("--check", case)
        scene.expect(outcome.status in (0, 2), way)
        return
    elif way == "amplitude":
        scene.edit(case, "'linear_modes' /", "'linear_modes','qsma' /")
        scene.write(case, (scene.folder / case).read_text() + "&qsma mode=1, largest_amplitude=100.0, levels=3 /\n"
                    "&output sensors='top', sensor_direction=1,0,0 /\n")
        outcome = scene.run("--check", case)
        scene.expect(outcome.status == 2 or "warnings, worst first" in outcome.said, "amplitude of 100 m passed in silence")
        return
    elif way == "damping in %":
        scene.edit(case, "&reduction", "&damping modal_ratio=20*0.5 /\n&reduction")
        outcome = scene.run(case, "--output", "out.h5")
        scene.expect(outcome.status == 2 or scene.loudest("out.h5") >= 2, "damping ratio of 0.5 passed in silence")
        return
    else:
        case = "scan.nml"
        with h5py.File(scene.folder / "model.h5", "r+") as file:
            file["coordinates"][...] *= 1e3
        scene.protect("model.h5")
    scene.not_in_silence(case, "out.h5", f"units: {way}")


def surfaces(scene, rng):
    """Scans as other programs leave them."""
    way = rng.choice(["square transposed", "sentinel", "nan patch", "axes in m", "heights in m", "scale attribute", "descending", "spike",
                      "swapped axes", "infinity", "2-D axes", "text", "mask", "shifted", "uneven"])
    path = scene.folder / "scan.h5"
    if way == "square transposed":
        hill_scan(path, shape=(35, 35))
        with h5py.File(path, "r+") as file:
            file["x"][...] = file["y"][...] = np.linspace(-22, 22, 35)
            file["z"][...] = file["z"][()].T
    elif way == "heights in m":
        hill_scan(path, units=("mm", "m"))
    elif way == "axes in m":
        hill_scan(path, units=("m", "um"))
    elif way == "text":
        path.write_text("x,y,z\n0,0,1\n")
    else:
        with h5py.File(path, "r+") as file:
            x, y, z = (file[name][()] for name in "xyz")
            i, j = rng.randrange(8, 33), rng.randrange(6, 25)
            if way == "sentinel":
                z[i:i + 3, j:j + 3] = rng.choice([-9999.0, 9999.0, 3.4e38, 0.0, -32768.0, 1e30])
            elif way == "nan patch":
                z[25:33, 18:26] = np.nan
            elif way == "spike":
                z[i, j] += rng.choice([50.0, 1000.0])
            elif way == "infinity":
                z[i, j] = rng.choice([np.inf, -np.inf])
            elif way == "descending":
                x = x[::-1].copy()
            elif way == "shifted":
                x = x + rng.choice([22.0, 100.0, -1000.0])
            elif way == "uneven":
                x[5] = x[6] - 1e-9
            elif way == "mask":
                file["mask"] = np.zeros(z.shape, dtype=bool)
            elif way == "scale attribute":
                name = rng.choice(["scale_factor", "height_scale_factor", "add_offset", "unit_scale"])
                file["z"].attrs[name] = 0.01
            del file["x"], file["y"]
            units = {"swapped axes": (y, x), "2-D axes": (np.tile(x, (len(y), 1)), y)}.get(way, (x, y))
            for name, values in zip("xy", units):
                file[name] = values
                file[name].attrs["units"] = "mm"
            file["z"][...] = z
    scene.protect("scan.h5")
    scene.not_in_silence("scan.nml", "out.h5", f"scan: {way}")


def typing(scene, rng):
    """One letter of a group or key that is wrong, a key of another group, a value of another type."""
    case = rng.choice(["block.nml", "scan.nml", "kick.nml"])
    text = (scene.folder / case).read_text()
    way = rng.choice(["letter", "foreign key", "no comma", "quote", "twice", "decimal comma"])
    words = [word for word in ("&interface", "&reduction", "&preload", "side_a", "side_b", "friction", "n_modes", "interface_force",
                               "node_set", "direction", "distribution", "analyses") if word in text]
    word = rng.choice(words)
    if way == "letter":
        k = rng.randrange(2, len(word))
        wrong = word[:k] + rng.choice("xqzw") + word[k + 1:]
        scene.write(case, text.replace(word, wrong, 1))
        if wrong == word:
            return
    elif way == "foreign key":
        scene.write(case, text.replace("&reduction ", "&reduction friction=0.3, ", 1))
    elif way == "no comma":
        scene.write(case, text.replace("interface_force=1000.0", "interface_force=1000.0.0", 1))
    elif way == "quote":
        scene.write(case, text.replace("'top'", "'top", 1))
    elif way == "twice":
        scene.write(case, text.replace("interface_force=1000.0", "interface_force=1000.0, interface_force=2000.0", 1))
    else:
        scene.write(case, text.replace("friction=0.5", "friction=0,5", 1))
    scene.refused(scene.run(case, "--output", "out.h5"), f"{case}: {way} {word}")


KINDS = [renumbered, renumbered, matrices, matrices, matrices, decks, decks, units, units, surfaces, surfaces, typing]
