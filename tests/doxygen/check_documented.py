#!/usr/bin/python3
"""Checks that functions and enumerations of public headers have comments: check_documented.py XML_FOLDER

Reads Doxygen's XML. A comment documents all declarations up to the next blank line, and the comment of
one overload documents all overloads. Fields, accessors and other functions that are defined where they
are declared, default, copy and move constructors, destructors and operators need no comment, nor do
four names that have one meaning in all headers:

  bind(table, options)  binds the options' fields to keys and flags
  X_names()             returns the names of an enumeration's values in flags and files
  to_text(value)        returns the name of a value
  check()               throws Error naming the first invalid field
"""

import pathlib
import sys
import xml.etree.ElementTree as ElementTree

KNOWN_NAMES = ("bind", "to_text", "check")


def is_documented(element):
    texts = element.findall("briefdescription") + element.findall("detaileddescription")
    return any("".join(text.itertext()).strip() for text in texts)


def explains_itself(member, owner):
    name = member.findtext("name")
    arguments = member.findtext("argsstring") or ""
    if member.get("inline") == "yes":
        return True
    if name == owner:
        copied = arguments.startswith((f"(const {owner} &", f"({owner} &&"))
        return copied or arguments.startswith("()")
    return name in KNOWN_NAMES or name.endswith("_names") or name.startswith(("operator", "~"))


def undocumented(compound):
    """Returns (file, line, declaration) of declarations without a comment in a class or namespace."""
    owner = compound.findtext("compoundname").split("::")[-1]
    missing = []
    documented = set()
    for member in compound.iter("memberdef"):
        if member.get("kind") not in ("function", "enum") or member.get("prot") == "private":
            continue
        name = member.findtext("name")
        if is_documented(member):
            documented.add(name)
        elif not explains_itself(member, owner):
            place = member.find("location")
            missing.append((name, place.get("file"), place.get("line"),
                            name + (member.findtext("argsstring") or "")))
    return [rest for name, *rest in missing if name not in documented]


def main():
    folder = pathlib.Path(sys.argv[1])
    compounds = [compound for file in sorted(folder.glob("*.xml")) if file.name != "index.xml"
                 for compound in ElementTree.parse(file).getroot().findall("compounddef")
                 if compound.get("kind") in ("class", "struct", "namespace")]
    missing = sorted({tuple(one) for compound in compounds for one in undocumented(compound)})
    for file, line, declaration in missing:
        print(f"{file}:{line}: no comment: {declaration}")
    if len(compounds) < 300:
        print(f"{folder}: only {len(compounds)} types and namespaces: not the whole documentation")
        return 1
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
