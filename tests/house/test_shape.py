"""The shape of the house: no room includes one of its own floor or above; no file over 600 lines; only shims are C++."""
import pathlib
import re
import sys

FLOORS = {"base": 1, "image": 2, "transport": 2, "device": 3, "solve": 3, "sim": 4, "rig": 4, "acquire": 5, "analysis": 5,
          "tradeoff": 6, "daemon": 7, "cli": 7}


def reaches_up(path, room, text):
    for include in re.findall(r'^\s*#\s*include\s+"([^"]+)"', text, re.M):
        other = include.split("/")[0]
        if other in FLOORS and other != room and FLOORS[other] >= FLOORS[room]:
            yield f"{path}: {room} includes {include}"


def main():
    source = pathlib.Path(sys.argv[1]) / "src"
    faults = []
    for path in sorted(p for p in source.rglob("*") if p.suffix in (".c", ".h", ".cpp")):
        room, text = path.relative_to(source).parts[0], path.read_text()
        if room not in FLOORS:
            faults.append(f"{path}: {room} is no room of the house")
            continue
        faults += reaches_up(path, room, text)
        if text.count("\n") > 600:
            faults.append(f"{path}: {text.count(chr(10))} lines; split it")
        if path.suffix == ".cpp" and not path.stem.endswith("_shim"):
            faults.append(f"{path}: C++ outside a shim")
        if re.search(r"\b(TODO|FIXME|XXX)\b", text):
            faults.append(f"{path}: a leftover")
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
