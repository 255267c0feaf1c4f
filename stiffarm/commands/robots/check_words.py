"""What `robots check` says: the answer, what is wrong and what to write, pose by pose."""

from __future__ import annotations

from typing import Any

# Orientations agree up to this, deg; controllers show hundredths.
SAME_deg = 0.1
HEADS = ("pose", "x y z read (mm)", "read less model (mm)", "distance (mm)", "put right (mm)")
SHORT = (0, 3, 4)


def headline(title: str, content: dict[str, Any]) -> str:
    """Whether positions agree, in a sentence."""
    far = f"{content['largest_mm']:.4g} mm over {content['poses']} poses, tolerance {content['tolerance_mm']:g} mm"
    agree = "agree" if content["largest_mm"] <= content["tolerance_mm"] else "do NOT agree"
    turned = content["orientation"]
    but = agree == "agree" and turned is not None and content["verdict"] != "agrees"
    return f"{title}: positions {agree} with the controller, {'orientations do NOT, ' if but else ''}" + (
        f"largest difference {far}"
    )


def rows(content: dict[str, Any]) -> list[tuple[str, ...]]:
    """Lines of the table pose by pose; the last: what is left when all that is named first is put right."""
    return [
        (
            one["pose"],
            _xyz(one["read_mm"]),
            _xyz(one["read_less_model_mm"]),
            f"{one['distance_mm']:.3f}",
            f"{one['then_mm']:.3f}",
        )
        for one in content["by_pose"]
    ]


def _xyz(values: list[float]) -> str:
    return "  ".join(f"{round(v, 2) + 0.0:.2f}" for v in values)


def told(content: dict[str, Any]) -> list[str]:
    """What is wrong and what to write in the model, line by line."""
    out: list[str] = []
    if content["misread_poses"]:
        poses = ", ".join(content["misread_poses"])
        out += [
            f"read or typed wrong: {poses} (all other poses agree)",
            f"  to fix it: read {poses} again; mind signs and the order of the columns",
        ]
    for i, one in enumerate(content["explanations"]):
        out += explained("what is wrong" if i == 0 else "or, which the table cannot tell apart", one)
    if content["more_explanations"]:
        out.append(f"and {content['more_explanations']} more: read poses in which every joint moves")
    if content["closest"] is not None:
        out.append(
            "no usual slip (sign, zero, coupling, length, base, tool, radians), up to three at once, explains this"
        )
        out += explained("the closest is", content["closest"])
        out.append("check that positions are in mm, in the robot's own frame and of the point that the model's tool is")
    out += [] if content["misread_poses"] else orientation(content["orientation"])
    if content["still_joints"]:
        out.append(f"not checked, because they hardly move over the poses: {', '.join(content['still_joints'])}")
    return out


def told_in_paragraphs(content: dict[str, Any]) -> list[str]:
    """The same, what belongs together in one paragraph; what is to be written as code."""
    out: list[str] = []
    for line in told(content):
        if line.startswith("  to fix it: "):
            out[-1] += f" To fix it: {remedied(line.removeprefix('  to fix it: '))}"
        elif line.startswith("  "):
            out[-1] += f" T{line.strip()[1:]}."
        else:
            out.append(f"{line[0].upper()}{line[1:]}.")
    return out


def remedied(remedy: str) -> str:
    """A remedy in a paragraph: as code where it is to be written."""
    return f"`{remedy}`" if " = " in remedy else f"{remedy}."


def todo(content: dict[str, Any]) -> str:
    """What to do first, in a paragraph; empty where nothing is to be done or known."""
    if content["verdict"] == "explained":
        return remedied(content["explanations"][0]["changes"][0]["remedy"])
    lines = told(content) if content["verdict"] in ("orientation", "misread") else []
    remedy = next((line.removeprefix("  to fix it: ") for line in lines if line.startswith("  to fix")), "")
    return remedied(remedy[0].upper() + remedy[1:]) if remedy else ""


def explained(opening: str, explanation: dict[str, Any]) -> list[str]:
    """One explanation: each change, how to mend it, and what is left then."""
    out: list[str] = []
    for change in explanation["changes"]:
        out += [f"{opening}: {change['words']}", f"  to fix it: {change['remedy']}"]
        opening = "and"
    if explanation["changes"]:
        out.append(f"  then the largest difference is {explanation['largest_mm']:.3g} mm")
    return out


def orientation(turned: dict[str, Any] | None) -> list[str]:
    """How orientations compare."""
    if turned is None:
        return []
    out: list[str] = []
    if turned["agrees_as"] is not None:
        out += [
            "orientations are not in the convention that their columns are named after: they agree as "
            + turned["agrees_as"].partition(":")[0],
            f"  to fix it: name the table's orientation so: {turned['agrees_as'].partition(': ')[2]}",
        ]
    if turned["largest_deg"] <= SAME_deg:
        return out or [f"orientations agree, largest difference {turned['largest_deg']:.2g} deg"]
    if turned["constant_tool_turn_rpy_deg"] is not None:
        rpy = ", ".join(f"{v:g}" for v in turned["constant_tool_turn_rpy_deg"])
        return [
            *out,
            f"orientations differ by one constant turn of the tool: rpy {rpy} deg in the flange frame",
            f"  to fix it: set [tool] rpy (or [controller] flange rpy) to [{rpy}] deg",
        ]
    return [
        f"orientations differ by up to {turned['largest_deg']:.4g} deg; no other convention, constant turn of the tool "
        "or slip of one joint explains that",
        "  to fix it: check the order of the columns, and that they are of the same tool and robot frame",
    ]
