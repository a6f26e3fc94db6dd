"""Mutations of case files, text files and HDF5 files. Every function takes a random.Random and returns the new content."""

import contextlib
import re
import shutil

import h5py
import numpy as np

LARGEST = 10**7  # elements of a dataset that is read to be damaged

NUMBER = re.compile(r"(?<![\w.'\"])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?(?![\w.'\"])")
#: Values that no key allows: a case with one of them in place of a number must be refused.
NEVER = ["NaN", "Infinity", "-Infinity", "1e400", "-1e400", "abc", "1.0.0", "'text'", "0x10", "1e", "(1.0, 2.0)"]
ODD = ["0", "-1", "1", "-0.0", "1e308", "-1e308", "1e-308", "1e-320", "2147483647", "2147483648", "-2147483649", "1e15",
       "99999999999999999999", "1d0", "3*1.0", "1000000*1.0", "2*", "*", "", ",,", ".true.", "T", "''", "7", "20", "1e-15"]
TEXTS = ["", " ", "x", "ground", "all", "/", ".", "..", "/dev/null", "/dev/zero", "x" * 65, "x" * 1100, "é", "a'b", "\t",
         "model.h5", "surface.h5", "blow.txt", "upper_pad", "press", "hit", "newton", "jacobi", "macneal", "file", "hill"]
GROUPS = ["case", "model", "interface", "topography", "reduction", "damping", "contact", "load", "preload",
          "linear_modes", "transient", "qsma", "ringdown", "harmonic_balance", "epmc", "settling", "excitation", "output"]
BYTES = ["\0", "\n", "\r\n", "\t", "&", "/", "!", "'", '"', "=", ",", ";", "(", ")", "*", "$", "%", "\xff", "é", " ", "0"]
INDICES = ["(1)", "(2)", "(0)", "(-1)", "(:)", "(2:1)", "(1:3)", "(:,2)", "(99999999999)", "(1:", "()", "(1:6:2)", "(1,1,1)"]


def case_text(text, rng, donors):
    """Mutate a case; also tells whether it must be refused whatever else it says."""
    must_fail = False
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        kind = rng.randrange(16)
        numbers = [m for m in NUMBER.finditer(text) if "!" not in text[text.rfind("\n", 0, m.start()) + 1:m.start()]]
        keys = list(re.finditer(r"\b(\w+)(\([^)]*\))?\s*=", text))
        strings = list(re.finditer(r"'[^'\n]*'", text))
        if kind == 0 and numbers:
            m = rng.choice(numbers)
            text, must_fail = text[:m.start()] + rng.choice(NEVER) + text[m.end():], True
        elif kind in (1, 2) and numbers:
            m = rng.choice(numbers)
            text = text[:m.start()] + rng.choice(ODD) + text[m.end():]
        elif kind == 3 and numbers:
            m = rng.choice(numbers)
            value = float(m.group().lower().replace("d", "e"))
            if not np.isfinite(value):
                continue
            new = value * 10.0 ** rng.uniform(-20, 20) * rng.choice((1, 1, -1)) + rng.choice((0, 0, 1))
            text = text[:m.start()] + (repr(new) if "." in m.group() or "e" in m.group() else str(int(np.clip(new, -1e12, 1e12)))) \
                + text[m.end():]
        elif kind in (4, 5) and strings:
            m = rng.choice(strings)
            text = text[:m.start()] + "'" + rng.choice(TEXTS + [s.group()[1:-1] for s in strings]) + "'" + text[m.end():]
        elif kind == 6 and keys:
            m = rng.choice(keys)
            names = m.group(1) + "x", m.group(1)[:-1], "file", "n_modes", "name", "x_y"
            text = text[:m.start(1)] + rng.choice(names) + text[m.end(1):]
        elif kind == 7 and keys:
            m = rng.choice(keys)
            text = text[:m.end(1)] + rng.choice(INDICES) + text[m.end(1):]
        elif kind == 8:
            lines = text.split("\n")
            k = rng.randrange(len(lines))
            lines[k:k + 1] = rng.choice(([], [lines[k]] * 2, [rng.choice(lines)], [lines[k][:len(lines[k]) // 2]]))
            text = "\n".join(lines)
        elif kind == 9:
            groups = re.split(r"(?m)^(?=&)", text)
            k = rng.randrange(len(groups))
            groups[k:k + 1] = rng.choice(([], [groups[k]] * 2, [rng.choice(groups), groups[k]]))
            text = "".join(groups)
        elif kind == 10:
            other = re.split(r"(?m)^(?=&)", rng.choice(donors))
            text = text + "\n" + rng.choice(other)
        elif kind == 11:
            at = rng.randrange(len(text) + 1)
            text = text[:at] + rng.choice(BYTES) * rng.choice((1, 1, 2, 300)) + text[at:]
        elif kind == 12:
            at = rng.randrange(len(text) + 1)
            text = text[:at] + text[at + rng.choice((1, 2, 10, 10**6)):]
        elif kind == 13:
            m = re.search(r"&\w+", text[rng.randrange(len(text)):])
            if m:
                text = text.replace(m.group(), "&" + rng.choice(GROUPS + ["x", "", "case_"]), 1)
        elif kind == 14 and keys:
            m = rng.choice(keys)
            text, must_fail = text[:m.start(1)] + rng.choice(("nonsense = 1, ", "colour = 'red', ")) + text[m.start(1):], True
        elif kind == 15 and keys:
            m = rng.choice(keys)
            end = text.find("\n", m.end())
            text = text[:m.end()] + " " + rng.choice(ODD + NEVER + [repr(t) for t in TEXTS]) + text[end if end > 0 else len(text):]
    # Another change may have put the wrong word into a remark or cut it off: then there is nothing to be refused.
    return text, must_fail and text.count("!") == 0 and "'" not in text


def data_text(text, rng):
    """Mutate lines and numbers of a text file."""
    for _ in range(rng.choice((1, 1, 2, 5))):
        kind = rng.randrange(7)
        lines = text.split("\n")
        k = rng.randrange(len(lines))
        if kind <= 2:
            numbers = list(NUMBER.finditer(lines[k]))
            if numbers:
                m = rng.choice(numbers)
                lines[k] = lines[k][:m.start()] + rng.choice(ODD + NEVER) + lines[k][m.end():]
        elif kind == 3:
            lines[k:k + 1] = rng.choice(([], [lines[k]] * 2, [rng.choice(lines)], [""]))
        elif kind == 4:
            words = lines[k].replace(",", " , ").split()
            rng.shuffle(words)
            lines[k] = " ".join(words[:rng.randrange(len(words) + 1)])
        elif kind == 5:
            at = rng.randrange(len(lines[k]) + 1)
            lines[k] = lines[k][:at] + rng.choice(BYTES) * rng.choice((1, 1, 3, 5000)) + lines[k][at:]
        else:
            lines = lines[:k]
        text = "\n".join(lines)
    return text


def hdf5(source, target, rng, any_bytes):
    """Copy an HDF5 file and damage it: its objects, or bytes of the file (any of them, or only its end)."""
    shutil.copyfile(source, target)
    if rng.random() < 0.2:
        data = bytearray(target.read_bytes())
        if not any_bytes:
            del data[rng.randrange(len(data)):]
            target.write_bytes(data)
            return
        for _ in range(rng.choice((1, 1, 4, 20))):
            data[rng.randrange(len(data)) if rng.random() < 0.6 else rng.randrange(min(2048, len(data)))] = rng.randrange(256)
        if rng.random() < 0.2:
            del data[rng.randrange(len(data)):]
        target.write_bytes(data)
        return
    with h5py.File(target, "r+") as file:
        names = []
        file.visit(names.append)
        for _ in range(rng.choice((1, 1, 2))):
            name = rng.choice(names)
            if _can_be_damaged(file, name):
                # What numpy or h5py refuse to write is left as far as it came.
                refused = AttributeError, KeyError, MemoryError, OSError, OverflowError, RuntimeError, TypeError, ValueError
                with np.errstate(all="ignore"), contextlib.suppress(*refused):
                    _damage(file, name, rng)


def _can_be_damaged(file, name):
    """An earlier damage may have led the name nowhere, to itself, or made it larger than the memory."""
    try:
        item = file[name]
    except (KeyError, RuntimeError, OSError):
        return False
    return (getattr(item, "size", 0) or 0) < LARGEST


def _damage(file, name, rng):
    """One object of a file."""
    item, kind = file[name], rng.randrange(8)
    if kind == 0 or not isinstance(item, h5py.Dataset) and kind < 6:
        del file[name]
        if rng.random() < 0.5:
            file[name] = rng.choice((0, 1.5, "text", np.zeros((0,)), np.zeros((2, 2, 2)), h5py.Empty("f8"), h5py.SoftLink("/gone"),
                                     h5py.ExternalLink("nowhere.h5", "/x"), h5py.SoftLink("/" + name)))
    elif kind <= 3 and item.size:
        data = item[...]
        flat = data.reshape(-1)
        for _ in range(rng.choice((1, 1, 3))):
            value = rng.choice((0, -1, 1, 2, 3, len(flat), len(flat) + 1, 2**31 - 1, -2**31, float("nan"), float("inf"),
                                1e300, -1e300, 1e-300, 1.5))
            if flat.dtype.kind in "iu" and not (np.isfinite(value) and abs(value) < 2**31):
                value = 7
            flat[rng.randrange(len(flat))] = value
        item[...] = data
    elif kind == 4:
        data = item[...]
        if data.ndim == 0:
            return
        data = rng.choice((data[:-1], data[:0], np.concatenate([data, data]), data.reshape(-1), data[..., None],
                           np.swapaxes(data, 0, -1), data[::-1]))
        attributes = dict(item.attrs)
        del file[name]
        file[name] = data
        file[name].attrs.update(attributes)
    elif kind == 5:
        data, attributes = item[...], dict(item.attrs)
        type_ = rng.choice(("f4", "f8", ">f8", "f2", "i1", "u8", ">i4", "i8", "S5", "c16", "?"))
        del file[name]
        file[name] = np.nan_to_num(np.asarray(data)).astype(type_)
        file[name].attrs.update(attributes)
    elif kind == 6:
        attributes = list(item.attrs)
        key = rng.choice(attributes) if attributes else "units"
        if attributes and rng.random() < 0.3:
            del item.attrs[key]
        else:
            item.attrs[key] = rng.choice(("", "mm", "km", "x" * 500, 0, 2, 1e300, [1, 2], "nm", np.bytes_("m"), h5py.Empty("f8")))
    elif isinstance(item, h5py.Dataset) and item.ndim:
        shape = tuple(rng.choice((n, n, 2**31, 10**6)) or 1 for n in item.shape)
        type_ = item.dtype
        del file[name]
        file.create_dataset(name, shape, type_, chunks=tuple(min(n, 10) for n in shape))
