"""FE models of the S4 Beam of different fineness, made by example/s4_beam/build_model and kept as HDF5."""
import os
import subprocess
import sys

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
SHIPPED = os.path.join(ROOT, "input", "s4_coarse.h5")

# Options of build_model. `coarse` is shipped.
OPTIONS = {
    "medium": ["--size", "coarse", "--around", "32", "--strip", "3", "--span", "48", "--thickness", "3", "--shank", "3"],
    "full": ["--size", "full"],
    "fine": ["--size", "full", "--around", "64", "--strip", "4", "--span", "80", "--thickness", "4", "--shank", "6"],
}


def model_file(name, program, folder):
    """The model's HDF5 file; built at the first call. Raises RuntimeError if that fails."""
    if name == "coarse":
        return SHIPPED
    file = os.path.join(os.path.abspath(folder), f"s4_{name}.h5")
    if not os.path.isfile(file):
        build(name, file, program, os.path.join(os.path.abspath(folder), name))
    return file


def build(name, file, program, folder):
    size = OPTIONS[name][1]
    call([sys.executable, os.path.join(ROOT, "example", "s4_beam", "build_model"), *OPTIONS[name], "--output", folder])
    case = os.path.join(folder, "convert.nml")
    with open(case, "w") as text:
        text.write(conversion_case(os.path.join(folder, "s4_" + size)))
    call([program, "--write-model", file + ".part", case])
    os.replace(file + ".part", file)
    for suffix in ("sti", "mas"):  # hundreds of MB
        os.remove(os.path.join(folder, f"s4_{size}.{suffix}"))


def conversion_case(base):
    """The smallest case with this model; only the model is used."""
    return ("&case  title = 'model', analyses = 'preload' /\n"
            f"&model\n  source = 'calculix', file = '{base}', mesh_file = '{base}.inp'\n"
            "  unit_length = 'mm', unit_mass = 't', unit_time = 's'\n/\n"
            "&interface\n  side_a = 'pad_left_upper', side_b = 'pad_left_lower', friction = 0.6\n"
            "  young_modulus = 194e9, poisson_ratio = 0.2854, nx = 8, ny = 5\n/\n"
            "&reduction  n_modes = 5 /\n"
            "&load  name = 'bolt', node_set = 'bolt_left_plane_upper', direction = 0, 0, -1, size = 1.0 /\n"
            "&preload  loads = 'bolt', load_scale = 1.0 /\n")


def call(command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise RuntimeError((done.stdout.strip().splitlines() or [f"{command[0]} failed"])[-1])
