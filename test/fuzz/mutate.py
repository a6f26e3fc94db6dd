"""Mutations of case files, text files and HDF5 files. Every function takes a random.Random and returns the new content."""

import contextlib
import re
import shutil
import warnings

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
#: Keys whose values are all positive; keys of texts that no other place knows; keys that their group cannot do without.
POSITIVE = ("young_modulus nx ny n_modes cutoff_frequency tolerance max_iterations initial_pressure potential_margin interface_force "
            "steps duration time_step safety amplitudes largest_amplitude smallest_amplitude levels interval impacts periods mode "
            "harmonics samples frequency_range frequency_step response_step max_points points amplitude_range frequency "
            "frequencies frequency_from frequency_to frequency_count rate measure_periods steady_tolerance most_windows stride "
            "checkpoint_interval checkpoint_steps reference_mode filter_wavelength cycle_steps").split()
FREE_TEXTS = ("title", "name", "cache", "file")
NEEDED = ("analyses source side_b plane_normal friction young_modulus poisson_ratio nx ny sense loads load kind "
          "frequency_range amplitude_range interval reference_mode rate frequency_to frequency_count interface").split()
BYTES = ["\0", "\n", "\r\n", "\t", "&", "/", "!", "'", '"', "=", ",", ";", "(", ")", "*", "$", "%", "\xff", "é", " ", "0"]
INDICES = ["(1)", "(2)", "(0)", "(-1)", "(:)", "(2:1)", "(1:3)", "(:,2)", "(99999999999)", "(1:", "()", "(1:6:2)", "(1,1,1)"]


def case_text(text, rng, donors):
    """Mutate a case; also tells whether it must be refused."""
    times = rng.choice((1, 1, 1, 2, 3))
    # Where several changes meet, one may undo the other.
    if times == 1 and rng.random() < 0.25:
        wrong = _wrong_case(text, rng)
        if wrong:
            return wrong, True
    for _ in range(times):
        text, must_fail = _changed_case(text, rng, donors)
    return text, must_fail and times == 1


def _plain(text):
    """The text with strings and remarks blanked out, of the same length."""
    return re.sub(r"'(?:[^'\n]|'')*'|\"[^\"\n]*\"|![^\n]*", lambda m: " " * len(m.group()), text)


def _wrong_case(text, rng):
    """A case with one fault that must be found; None where there is no place for it."""
    plain = _plain(text)
    kind = rng.randrange(5)
    keys = list(re.finditer(r"\b(\w+)\s*=", plain))
    if kind == 0:  # a key twice
        m = rng.choice(keys)
        return text[:m.start()] + m.group() + " 1, " + text[m.start():]
    if kind == 1:  # a second copy of a group
        groups = re.findall(r"(?ms)^&(\w+).*?(?<=\s)/$", plain)
        name = rng.choice([g for g in groups if g not in ("interface", "topography", "load", "excitation")])
        start = plain.index("&" + name)
        return text + "\n" + text[start:re.compile(r"(?m)(?<=\s)/$").search(plain, start).end()] + "\n"
    if kind == 2:  # a number that makes no sense there
        m = rng.choice([k for k in keys if k.group(1) in POSITIVE])
        number = NUMBER.search(plain, m.end())
        return text[:number.start()] + rng.choice(("0", "-1", "-0.5", "-1e-30", "-0.0")) + text[number.end():]
    if kind == 3:  # a name that does not exist
        found = [m for m in re.finditer(r"\b(\w+)(\(\d\))?\s*=\s*(\d\*)?(?=')", text) if m.group(1) not in FREE_TEXTS]
        m = rng.choice(found)
        return text[:m.end()] + "'no_such_thing'" + text[text.index("'", m.end() + 1) + 1:]
    # a key that the group needs
    found = [k for k in keys if k.group(1) in NEEDED]
    m = rng.choice(found)
    after = re.compile(r"\n|(?<=\s)/(?=\n)|,\s*(?=\w+\s*(\([^)]*\))?=)").search(plain, m.end())
    return text[:m.start()] + " " + text[after.start():].lstrip(",")


def _changed_case(text, rng, donors):
    """One change of a case; also tells whether it must be refused."""
    must_fail = False
    kind = rng.randrange(16)
    plain = _plain(text)
    numbers = list(NUMBER.finditer(plain))
    keys = list(re.finditer(r"\b(\w+)(\([^)]*\))?\s*=", plain))
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
        if np.isfinite(value):
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
    return text, must_fail


def data_text(text, rng):
    """Mutate lines and numbers of a text file; also tells whether a number became none."""
    must_fail = False
    times = rng.choice((1, 1, 2, 5))
    for _ in range(times):
        kind = rng.randrange(7)
        lines = text.split("\n")
        k = rng.randrange(len(lines))
        if kind <= 2:
            numbers = list(NUMBER.finditer(lines[k]))
            if numbers:
                m = rng.choice(numbers)
                new = rng.choice(ODD + NEVER)
                must_fail = times == 1 and new in NEVER
                lines[k] = lines[k][:m.start()] + new + lines[k][m.end():]
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
    return text, must_fail


def hdf5(source, target, rng, any_bytes):
    """Copy an HDF5 file and damage it: its objects, or bytes of the file (any of them, or only its end).

    Tells whether it must be refused."""
    shutil.copyfile(source, target)
    if rng.random() < 0.2:
        data = bytearray(target.read_bytes())
        if not any_bytes:
            del data[rng.randrange(len(data)):]
            target.write_bytes(data)
            return False
        for _ in range(rng.choice((1, 1, 4, 20))):
            data[rng.randrange(len(data)) if rng.random() < 0.6 else rng.randrange(min(2048, len(data)))] = rng.randrange(256)
        if rng.random() < 0.2:
            del data[rng.randrange(len(data)):]
        target.write_bytes(data)
        return False
    with h5py.File(target, "r+") as file:
        names = []
        file.visit(names.append)
        times, must_fail = rng.choice((1, 1, 2)), False
        for _ in range(times):
            name = rng.choice(names)
            if _can_be_damaged(file, name):
                # What numpy or h5py refuse to write is left as far as it came.
                refused = AttributeError, KeyError, MemoryError, OSError, OverflowError, RuntimeError, TypeError, ValueError
                with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"), contextlib.suppress(*refused):
                    must_fail = _damage(file, name, rng) and times == 1
    return must_fail


def _can_be_damaged(file, name):
    """An earlier damage may have led the name nowhere, to itself, or made it larger than the memory."""
    try:
        item = file[name]
    except (KeyError, RuntimeError, OSError):
        return False
    return (getattr(item, "size", 0) or 0) < LARGEST


def _damage(file, name, rng):
    """One object of a file; tells whether the file must be refused then."""
    item, kind = file[name], rng.randrange(8)
    if kind == 0 or not isinstance(item, h5py.Dataset) and kind < 6:
        del file[name]
        if rng.random() < 0.5:
            return not name.startswith("node_sets")
        else:
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
        # Heights may be unknown.
        return data.dtype.kind == "f" and bool(np.any(np.isinf(data)) or name != "z" and np.any(np.isnan(data)))
    elif kind == 4:
        data = item[...]
        if data.ndim == 0:
            return False
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
    return False
