"""Changes in the text of a case file: keys set, groups added or left out."""
import re


def edited(text, changes):
    """The case with `changes`: {group: {key: value as it stands in a case file}}, or {group: None} to leave it out.

    A group that may appear several times is changed everywhere; 'load NAME' is the one with that name. A group that is
    not there is added at the end.
    """
    for group, keys in changes.items():
        found = [match for match in GROUP.finditer(text) if is_meant(match, group)]
        if not found and keys is not None:
            text += f"\n&{group}\n" + "".join(f"  {key} = {value}\n" for key, value in keys.items()) + "/\n"
        for match in reversed(found):
            new = "" if keys is None else set_keys(match.group(), keys)
            text = text[:match.start()] + new + text[match.end():]
    return text


GROUP = re.compile(r"^&(\w+)\n.*?^/\n", re.MULTILINE | re.DOTALL)  # as all shipped cases are written


def is_meant(match, group):
    kind, _, name = group.partition(" ")
    return match.group(1) == kind and (not name or re.search(rf"\bname = '{name}'", match.group()) is not None)


def set_keys(group, keys):
    """Key by key: its value is replaced, or the key added; the line of a key without value is left out."""
    for key, value in keys.items():
        if value is None:
            group = re.sub(rf"^ *{key} = .*\n", "", group, flags=re.MULTILINE)
            continue
        # A value ends where the next key of the line begins, or with the line.
        there = re.compile(rf"\b{key} = .*?(?=, \w+ = |$)", re.MULTILINE)
        if there.search(group):
            group = there.sub(lambda _: f"{key} = {value}", group, count=1)
        else:
            group = group[:-2] + f"  {key} = {value}\n/\n"
    return group
