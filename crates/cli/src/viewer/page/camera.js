// How cameras and suns move: plain vector arithmetic on what scene files say.

const plus = (a, b) => a.map((value, axis) => value + b[axis]);
const times = (a, factor) => a.map((value) => value * factor);
const minus = (a, b) => plus(a, times(b, -1));
const dot = (a, b) => a.reduce((sum, value, axis) => sum + value * b[axis], 0);
const cross = ([ax, ay, az], [bx, by, bz]) => [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
const length = (a) => Math.sqrt(dot(a, a));
const unit = (a) => times(a, 1 / length(a));

/** How near to straight up or down a camera may look, radians. */
const POLE = 0.02;

/** A vector turned about a unit axis (Rodrigues). */
const rotated = (a, axis, angle) => plus(plus(times(a, Math.cos(angle)), times(cross(axis, a), Math.sin(angle))),
    times(axis, dot(axis, a) * (1 - Math.cos(angle))));

const inside = (camera) => Object.entries(camera)[0];

/** A camera that has moved around what it looks at: by angles to the right and down. */
export function turned(camera, right, down) {
    const [kind, settings] = inside(camera);
    const up = unit(settings.up);
    const offset = minus(settings.position, settings.look_at);
    const height = Math.acos(Math.max(-1, Math.min(1, dot(unit(offset), up))));
    const tilt = Math.max(POLE, Math.min(Math.PI - POLE, height - down)) - height;
    const across = cross(up, offset);
    const sideways = length(across) > 0 ? unit(across) : unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
    const moved = rotated(rotated(offset, sideways, tilt), up, -right);
    return { [kind]: { ...settings, position: plus(settings.look_at, moved) } };
}

/** A camera that has moved with what it looks at: by parts of the picture's height, to the left and up. */
export function shifted(camera, x, y) {
    const [kind, settings] = inside(camera);
    const line = minus(settings.look_at, settings.position);
    const right = unit(cross(line, settings.up));
    const up = unit(cross(right, line));
    const height = settings.height ?? 2 * length(line) * Math.tan(settings.vertical_field_of_view * Math.PI / 360);
    const by = plus(times(right, -x * height), times(up, y * height));
    return { [kind]: { ...settings, position: plus(settings.position, by), look_at: plus(settings.look_at, by) } };
}

/** A camera whose distance from what it looks at, or whose picture, is `factor` times as large. */
export function approached(camera, factor) {
    const [kind, settings] = inside(camera);
    if (settings.height !== undefined) return { [kind]: { ...settings, height: settings.height * factor } };
    const offset = times(minus(settings.position, settings.look_at), factor);
    return { [kind]: { ...settings, position: plus(settings.look_at, offset) } };
}

/** Two unit vectors across `up`. */
function plane(up) {
    const first = unit(cross(up, Math.abs(up[1]) < 0.9 * length(up) ? [0, 1, 0] : [0, 0, 1]));
    return [first, unit(cross(up, first))];
}

/** Azimuth and elevation of a direction, degrees. */
export function anglesOf(direction, up) {
    const [first, second] = plane(up);
    const towards = unit(direction);
    const degrees = 180 / Math.PI;
    return {
        azimuth: Math.atan2(dot(towards, second), dot(towards, first)) * degrees,
        elevation: Math.asin(Math.max(-1, Math.min(1, dot(towards, unit(up))))) * degrees,
    };
}

/** The direction with an azimuth and an elevation in degrees. */
export function directionOf(azimuth, elevation, up) {
    const [first, second] = plane(up);
    const [turn, rise] = [azimuth, elevation].map((angle) => angle * Math.PI / 180);
    const level = plus(times(first, Math.cos(turn)), times(second, Math.sin(turn)));
    return plus(times(level, Math.cos(rise)), times(unit(up), Math.sin(rise)));
}
