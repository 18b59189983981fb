"""The functions of `synthesis_pieces`."""

from __future__ import annotations

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel import angle_terms, balls, contact_rows, narrowing
from handfast.synthesis.search.kernel.contact_equations import evaluate
from handfast.synthesis.search.kernel.krawczyk import certify
from handfast.synthesis.search.kernel.object_pose import turning
from handfast.synthesis.search.kernel.taylor import element
from handfast.synthesis.search.workspace import LocalWork, PoseWork, SetWork
from handfast.synthesis.task_groups import Flat


@inner
def evaluated(x, chains, regions, coordinates, values, contact):
    evaluate(x.ball, Flat(chains, regions, coordinates), values, contact)
    return 0


@inner
def taken(k, chains, regions, coordinates, question, box, polynomials, taylor, line, terms):
    """Taylor polynomials of contact k."""
    work = SetWork(box, polynomials, taylor, line, terms)
    element(k, 0, Flat(chains, regions, coordinates), question.derivative_bounds, work)
    return 0


@inner
def certified(x, chains, regions, coordinates, bounds, here, there, contact, step, proof, place, out):
    work = LocalWork(here, there, contact, step, proof, place)
    return 1 if certify(x.ball, Flat(chains, regions, coordinates), bounds, work, out.chosen, out.radii) else 0


@inner
def operated(numbers):
    a, b = (numbers.of[0, 0], numbers.of[0, 1]), (numbers.of[1, 0], numbers.of[1, 1])
    results = (
        balls.add(a, b), balls.sub(a, b), balls.mul(a, b), balls.div(a, b), balls.root(a), balls.sine(a),
        balls.cosine(a), balls.scale(3.7, a),
    )  # fmt: skip
    for k in range(8):
        numbers.result[k, 0], numbers.result[k, 1] = results[k]
    return 0


@inner
def narrowed(value, least, most, row, box):
    return 1 if narrowing.narrow(value, row.gradient, least, most, box, row.use) else 0


@inner
def together(position, rows, chains, regions, coordinates, box, polynomials, taylor, turned, inner):
    task, work = Flat(chains, regions, coordinates), PoseWork(box, polynomials, taylor, turned, inner)
    errors = rows.errors[0], rows.errors[1], rows.errors[2]
    return 1 if contact_rows.not_apart(0, rows.use, position, errors, task, work) else 0


@inner
def turned(box, out):
    out.bounds[0], out.bounds[1] = turning(box, 0, out.rotation, out.turn)
    return 0


@inner
def unit_line(remainder, stray, box, row, line):
    """The unit vector along a line on the hand."""
    angle_terms.unit(0, remainder, stray, box.half, row.use, line)
    return 0


@inner
def multiplied(polynomials, box, row, terms):
    """Of three directions, of contacts 0, 1, 2: into slot 0 the product of the first two, into 1 that of all."""
    a, b, c = (
        angle_terms.direction(0, 1, polynomials), angle_terms.direction(1, 1, polynomials),
        angle_terms.direction(2, 1, polynomials),
    )  # fmt: skip
    angle_terms.product(0, a, b, box.half, row.use, terms)
    angle_terms.triple(1, a, b, c, box.half, row.use, terms)
    return 0
