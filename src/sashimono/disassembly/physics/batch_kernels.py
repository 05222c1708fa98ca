"""The Warp kernels of `batch`: one step of many pushes at once. One source for GPU and processor.

Lengths are over the assembly's size, so that single precision is fine everywhere. A *slot* of an attempt is one
sample point: first those of the moving part, then those of each fixed one.
"""

# Warp reads the types of kernel arguments: no postponed annotations, and no other reader of types
from typing import no_type_check

import warp as wp


@wp.func
@no_type_check
def signed_distance(mesh: wp.uint64, point: wp.vec3, reach: float):
    """Signed distance to a mesh, negative inside, and its gradient; (reach, 0) if the surface is farther."""
    distance, gradient = reach, wp.vec3()
    query = wp.mesh_query_point_sign_normal(mesh, point, reach)
    if query.result:
        away = point - wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        gap = wp.length(away)
        distance = query.sign * gap
        gradient = wp.mesh_eval_face_normal(mesh, query.face)
        if gap > 1.0e-5:
            gradient = query.sign * away / gap
    return distance, gradient


@wp.kernel
@no_type_check
def find_contacts(
    moving: wp.array(dtype=int),
    others: wp.array2d(dtype=int),
    displacement: wp.array(dtype=wp.transform),
    done: wp.array(dtype=int),
    assembled: wp.array(dtype=wp.transform),
    meshes: wp.array(dtype=wp.uint64),
    centers: wp.array(dtype=wp.vec3),
    sizes: wp.array(dtype=float),
    overlaps: wp.array2d(dtype=float),
    samples: wp.array2d(dtype=wp.vec3),
    sample_normals: wp.array2d(dtype=wp.vec3),
    gap: float,
    facing: float,
    gaps: wp.array2d(dtype=float),
    normals: wp.array2d(dtype=wp.vec3),
    arms: wp.array2d(dtype=wp.vec3),
):
    """The clearance, the normal into the moving part and the arm from its centre, at one slot of one attempt."""
    attempt, slot = wp.tid()
    gaps[attempt, slot] = 1.0e9
    if done[attempt] != 0:
        return
    a = moving[attempt]
    pose = wp.transform_multiply(displacement[attempt], assembled[a])
    center = wp.transform_point(pose, centers[a])
    count = samples.shape[1]
    if slot < count:
        point = wp.transform_point(pose, samples[a, slot])
        normal = wp.transform_vector(pose, sample_normals[a, slot])
        best = float(1.0e9)
        for k in range(others.shape[1]):
            b = others[attempt, k]
            if b >= 0:
                near = gap * wp.min(sizes[a], sizes[b]) + overlaps[a, b]
                back = wp.transform_inverse(assembled[b])
                distance, gradient = signed_distance(meshes[b], wp.transform_point(back, point), near)
                gradient = wp.transform_vector(assembled[b], gradient)
                clearance = distance + overlaps[a, b]
                if distance < near and -wp.dot(gradient, normal) > facing and clearance < best:
                    best = clearance
                    gaps[attempt, slot] = clearance
                    normals[attempt, slot] = gradient
                    arms[attempt, slot] = point - center
    else:
        b = others[attempt, slot / count - 1]
        if b < 0:
            return
        near = gap * wp.min(sizes[a], sizes[b]) + overlaps[a, b]
        point = wp.transform_point(assembled[b], samples[b, slot % count])
        normal = wp.transform_vector(assembled[b], sample_normals[b, slot % count])
        back = wp.transform_inverse(pose)
        distance, gradient = signed_distance(meshes[a], wp.transform_point(back, point), near)
        gradient = wp.transform_vector(pose, gradient)
        if distance < near and -wp.dot(gradient, normal) > facing:
            gaps[attempt, slot] = distance + overlaps[a, b]
            normals[attempt, slot] = -gradient
            arms[attempt, slot] = point - center


@wp.func
@no_type_check
def speed(axis: wp.vec3, arm: wp.vec3, v: wp.vec3, w: wp.vec3) -> float:
    return wp.dot(axis, v) + wp.dot(wp.cross(arm, axis), w)


@wp.func
@no_type_check
def tangent(normal: wp.vec3) -> wp.vec3:
    helper = wp.vec3(1.0, 0.0, 0.0)
    if wp.abs(normal[0]) > 0.6:
        helper = wp.vec3(0.0, 1.0, 0.0)
    return wp.normalize(wp.cross(normal, helper))


@wp.func
@no_type_check
def relax(
    attempt: int,
    count: int,
    contacts: wp.array2d(dtype=int),
    gaps: wp.array2d(dtype=float),
    normals: wp.array2d(dtype=wp.vec3),
    arms: wp.array2d(dtype=wp.vec3),
    impulses: wp.array2d(dtype=wp.vec3),
    slack: float,
    radius: float,
    friction: float,
    start_v: wp.vec3,
    start_w: wp.vec3,
):
    """One round of projected Gauss-Seidel over the contacts of an attempt, as in `friction.sliding_twist`."""
    v, w = start_v, start_w
    for c in range(count):
        slot = contacts[attempt, c]
        n = normals[attempt, slot]
        arm = arms[attempt, slot] / radius
        old = impulses[attempt, c]
        t1 = tangent(n)
        t2 = wp.cross(n, t1)
        clearance = (gaps[attempt, slot] + slack) / radius
        turn = wp.cross(arm, n)
        push = wp.max(0.0, old[0] - (speed(n, arm, v, w) + clearance) / (1.0 + wp.dot(turn, turn)))
        v += (push - old[0]) * n
        w += (push - old[0]) * turn
        side1, side2 = wp.cross(arm, t1), wp.cross(arm, t2)
        f1 = old[1] - speed(t1, arm, v, w) / (1.0 + wp.dot(side1, side1))
        f2 = old[2] - speed(t2, arm, v, w) / (1.0 + wp.dot(side2, side2))
        size = wp.sqrt(f1 * f1 + f2 * f2)
        if size > friction * push:
            f1 = f1 * friction * push / size
            f2 = f2 * friction * push / size
        v += (f1 - old[1]) * t1 + (f2 - old[2]) * t2
        w += (f1 - old[1]) * side1 + (f2 - old[2]) * side2
        impulses[attempt, c] = wp.vec3(push, f1, f2)
    return v, w


@wp.kernel
@no_type_check
def advance(
    step: int,
    moving: wp.array(dtype=int),
    push_v: wp.array(dtype=wp.vec3),
    push_w: wp.array(dtype=wp.vec3),
    assembled: wp.array(dtype=wp.transform),
    centers: wp.array(dtype=wp.vec3),
    radii: wp.array(dtype=float),
    sizes: wp.array(dtype=float),
    low: wp.array(dtype=wp.vec3),
    high: wp.array(dtype=wp.vec3),
    stride: float,
    slack: float,
    friction: float,
    rest: float,
    iterations: int,
    gaps: wp.array2d(dtype=float),
    normals: wp.array2d(dtype=wp.vec3),
    arms: wp.array2d(dtype=wp.vec3),
    contacts: wp.array2d(dtype=int),
    impulses: wp.array2d(dtype=wp.vec3),
    displacement: wp.array(dtype=wp.transform),
    done: wp.array(dtype=int),
    steps: wp.array(dtype=int),
    history: wp.array2d(dtype=wp.transform),
):
    """Move one attempt's part by one step: as its push and its contacts have it. ``done``: 1 at rest, 2 out."""
    attempt = wp.tid()
    if done[attempt] != 0:
        return
    a = moving[attempt]
    radius = radii[a]
    # contacts in the order of the slots, thinned evenly where there are too many: the same on every device
    total = int(0)
    for slot in range(gaps.shape[1]):
        if gaps[attempt, slot] < 1.0e8:
            total += 1
    most = contacts.shape[1]
    every = (total + most - 1) / most
    seen, count = int(0), int(0)
    for slot in range(gaps.shape[1]):
        if gaps[attempt, slot] < 1.0e8:
            if every <= 1 or (seen + step) % every == 0:
                if count < most:
                    contacts[attempt, count] = slot
                    impulses[attempt, count] = wp.vec3()
                    count += 1
            seen += 1
    length = stride * sizes[a] / radius
    v, w = length * push_v[attempt], length * push_w[attempt]
    for _round in range(iterations):
        v, w = relax(attempt, count, contacts, gaps, normals, arms, impulses, slack * sizes[a], radius, friction, v, w)
    moved = wp.sqrt(wp.dot(v, v) + wp.dot(w, w))
    if moved < rest * length:
        done[attempt] = 1
        return
    pose = displacement[attempt]
    center = wp.transform_point(wp.transform_multiply(pose, assembled[a]), centers[a])
    spin = wp.quat_identity()
    angle = wp.length(w)
    if angle > 1.0e-9:
        spin = wp.quat_from_axis_angle(w / angle, angle)
    turned = wp.transform(center + radius * v - wp.quat_rotate(spin, center), spin)
    pose = wp.transform_multiply(turned, pose)
    pose = wp.transform(wp.transform_get_translation(pose), wp.normalize(wp.transform_get_rotation(pose)))
    displacement[attempt] = pose
    history[attempt, step + 1] = pose
    steps[attempt] = step + 1
    center += radius * v
    outside = wp.max(wp.max(low[attempt] - center, center - high[attempt]), wp.vec3())
    if wp.length(outside) > radius:
        done[attempt] = 2
