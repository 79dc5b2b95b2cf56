"""Changes of nested data: YAML, JSON and XML by their values, keys, attributes and elements."""

from __future__ import annotations

import copy
import json
from typing import Any

from fuzz.texts import HEADERS, Random, UnfitError, decoded, lines_changed, number, odd, text


def _value(rng: Random) -> Any:
    """A value nobody expects in a tree."""
    return rng.choice(
        (
            *(
                None,
                True,
                False,
                0,
                -1,
                1,
                2**31,
                2**63,
                10**30,
                10**400,
                -(10**18),
                0.5,
                1e308,
                1e-300,
            ),
            *(
                float("nan"),
                float("inf"),
                -float("inf"),
                "",
                " ",
                "x",
                odd(rng),
                odd(rng),
                odd(rng),
            ),
            *([], {}, [[]], {"": {}}, [None], [1, 2], [0.0, 1.0, 0.0], [[1, 0], [0, 1]], {"a": 1}),
            *("ur10", "auto", "data", "1e-6", "2021-03-04", rng.choice(HEADERS)),
        )
    )


def _places(tree: Any, path: tuple = ()) -> list[tuple]:
    found = [path]
    if isinstance(tree, dict):
        items = list(tree.items())
    elif isinstance(tree, list):
        items = list(enumerate(tree[:40]))
    else:
        return found
    for key, value in items:
        found += _places(value, (*path, key))
    return found


def tree(data: Any, rng: Random) -> Any:
    """One change of nested dictionaries and lists: values, keys, types, items."""
    data = copy.deepcopy(data)
    places = _places(data)
    if rng.random() < 0.4:  # deep lists hold most places, and are read by one line of code
        places = [each for each in places if len(each) < 4]
    path = rng.choice(places)
    if not path:
        return _value(rng) if rng.random() < 0.1 else tree(data, rng)
    around = data
    for step in path[:-1]:
        around = around[step]
    key, value, kind = path[-1], around[path[-1]], rng.randrange(12)
    if kind <= 2 and isinstance(value, int | float | str) and not isinstance(value, bool):
        word = number(str(value), rng) if not isinstance(value, str) else odd(rng)
        try:
            around[key] = float(word) if not isinstance(value, str) else word
        except ValueError:
            around[key] = word
    elif kind <= 4:
        around[key] = _value(rng)
    elif kind == 5:
        del around[key]
    elif kind == 6:
        other = rng.choice(_places(data))
        taken = data
        for step in other:
            taken = taken[step]
        around[key] = copy.deepcopy(taken)
    elif kind == 7 and isinstance(around, dict):
        name = rng.choice(
            (odd(rng), str(key).upper(), f"{key}_", str(key).replace("deg", "rad"), 1, None)
        )
        around[name] = around.pop(key)
    elif kind == 8 and isinstance(around, dict):
        around[rng.choice((odd(rng), "name", 1, True, None, 0.5))] = _value(rng)
    elif kind == 9 and isinstance(around, list):
        around[key:key] = [copy.deepcopy(value)] * rng.choice((1, 1, 2, 20))
    elif kind == 10:
        around[key] = rng.choice(([value], {"a": value}, str(value), [value, value]))
    elif kind == 11 and isinstance(value, list):
        rng.shuffle(value)
    else:
        around[key] = _value(rng)
    return data


def yaml_text(data: bytes, rng: Random) -> bytes:
    """A YAML file: its tree, or its text with what only YAML has."""
    import yaml

    whole, _ = decoded(data)
    if rng.random() < 0.25 or "[" * 1000 in whole:  # nested without end: no tree is made of it
        return _yaml_marks(whole, rng).encode("utf-8", "replace")
    try:
        changed = tree(yaml.load(whole, Loader=yaml.CSafeLoader), rng)
        return yaml.dump(
            changed,
            Dumper=yaml.CSafeDumper,
            default_flow_style=rng.choice((None, True, False)),
            sort_keys=False,
        ).encode("utf-8", "replace")
    except (yaml.YAMLError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise UnfitError from error


_TAGS = (
    *("!!int", "!!float", "!!binary", "!!set", "&a", "!x", "!!timestamp", "!!bool", "!!null"),
    *("!!omap", "!!str", "!!python/object:os.system", "!!float x", "!!timestamp 2021-13-45"),
)


def _yaml_marks(whole: str, rng: Random) -> str:
    lines = whole.split("\n")
    at = rng.randrange(len(lines))
    kind = rng.randrange(10)
    if kind == 0:
        key, colon, value = lines[at].partition(":")
        lines[at] = f"{key}{colon} {rng.choice(_TAGS)}{value}"
    elif kind == 1:
        lines[at:at] = [lines[at]]
    elif kind == 2:
        lines[at] = "\t" + lines[at]
    elif kind == 3:
        lines[at] = "  " * rng.choice((1, 2, 20)) + lines[at]
    elif kind == 4:
        lines[at:at] = [
            rng.choice(("<<: *a", "? [a, b]", "---", "...", "%YAML 1.1", "&a a: *a", "- - -"))
        ]
    elif kind == 5:
        lines[at] = lines[at].split(":")[0] + ": " + "[" * rng.choice((3, 11, 13, 100_000))
    elif kind == 6:
        lines[at] = lines[at].split(":")[0] + ": " + odd(rng).replace("\n", " ")
    elif kind == 7:
        depth = rng.choice((2, 6, 12, 40))
        lines[at:at] = [" " * i + "a:" for i in range(depth)]
    elif kind == 8:
        words = [f"a0: &a0 [{'1, ' * 9}1]"]
        words += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
        lines[at:at] = rng.choice((words, words[:3], ["seed: &a [*a, *a]"]))
    else:
        return "\n".join(lines_changed(lines, rng))
    return "\n".join(lines)


def json_text(data: bytes, rng: Random) -> bytes:
    """A JSON file: its tree, sometimes with a key twice."""
    try:
        whole = json.dumps(tree(json.loads(data), rng))
    except (ValueError, TypeError) as error:
        raise UnfitError from error
    if rng.random() < 0.05:
        whole = whole.replace("{", '{"a": 1, "a": [], ', 1)
    if rng.random() < 0.02:
        whole = rng.choice(
            ("[" * 100_000, '{"format": 1, "seed": ' + "9" * 100_000 + "}", whole * 2)
        )
    return whole.encode()


def xml_text(data: bytes, rng: Random) -> bytes:
    """An XML file: elements and attributes dropped, doubled, moved, renamed, with other values."""
    from lxml import etree

    try:
        root = etree.fromstring(data)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise UnfitError from error
    elements = list(root.iter("*"))
    one, kind = rng.choice(elements), rng.randrange(9)
    try:
        if kind <= 3:
            names = list(one.attrib)
            if names and rng.random() < 0.85:
                name = rng.choice(names)
                if kind == 0:
                    del one.attrib[name]
                else:
                    one.set(name, _attribute(one.get(name), rng))
            else:
                one.set(rng.choice(("name", "xyz", "lower", "link", "type")), odd(rng))
        elif kind == 4 and one.getparent() is not None:
            one.getparent().remove(one)
        elif kind == 5:
            rng.choice(elements).append(
                copy.deepcopy(one) if one is not root else etree.Element("joint")
            )
        elif kind == 6:
            one.tag = rng.choice(
                ("joint", "link", "robot", "parent", "child", "axis", "limit", "x")
            )
        elif kind == 7:
            one.append(
                etree.Element(rng.choice(("joint", "link", "mimic", "origin", "parent", "axis")))
            )
        else:
            one.text = odd(rng)
    except ValueError:  # what XML cannot hold
        return text(data, rng)
    return etree.tostring(root)


def _attribute(value: str, rng: Random) -> str:
    kinds = ("revolute", "prismatic", "fixed", "continuous", "planar", "floating", "l0", "l3", "j1")
    words = value.split()
    if words and rng.random() < 0.5:
        at = rng.randrange(len(words))
        words[at] = number(words[at], rng)
        return " ".join(words)
    return rng.choice(
        (rng.choice(kinds), odd(rng), value + " 1", "", "0 0 0", "1 0 0", "0 0 1e-12")
    )
