// Moves the camera and the sun, sends where they are, and shows the frames that come back.

import { anglesOf, approached, directionOf, shifted, turned } from './camera.js';

const picture = document.querySelector('#picture');
const progress = document.querySelector('#progress');
const problem = document.querySelector('#problem');
const copied = document.querySelector('#copied');
const sun = document.querySelector('#sun');
const sliders = { azimuth: document.querySelector('#azimuth'), elevation: document.querySelector('#elevation') };

/** Radians of a turn for each pixel that is dragged, and for a key. */
const TURN = 0.006;
const KEY_TURN = 0.05;

/** Pause before a question that failed is asked again, milliseconds. */
const RETRY = 1000;

let shown;
let look;
/** Number of the look that the page knows: its own last one, or one of another page. */
let known = 0;
/** The look that is to be sent next, while another is on its way. */
let waiting = null;
let isSending = false;

async function send() {
    copied.textContent = '';
    if (isSending) {
        waiting = look;
        return;
    }
    isSending = true;
    waiting = look;
    while (waiting) {
        const body = JSON.stringify(waiting);
        waiting = null;
        try {
            const headers = { 'content-type': 'application/json' };
            const answer = await fetch('look', { method: 'POST', headers, body });
            const content = await answer.json();
            problem.textContent = answer.ok ? '' : content.detail;
            if (answer.ok) known = content.look;
        } catch {
            problem.textContent = 'Clerestory does not answer.';
        }
    }
    isSending = false;
}

function change(camera) {
    look = { ...look, camera };
    send();
}

function showSun() {
    sun.hidden = !look.sun;
    if (!look.sun) return;
    const angles = anglesOf(look.sun, upOf(look.camera));
    for (const [name, slider] of Object.entries(sliders)) {
        slider.value = angles[name];
        slider.parentElement.querySelector('output').value = `${Number(slider.value).toFixed(1)}\u00b0`;
    }
}

const kindOf = (camera) => Object.keys(camera)[0];
const upOf = (camera) => camera[kindOf(camera)].up;

for (const slider of Object.values(sliders)) {
    slider.addEventListener('input', () => {
        const { azimuth, elevation } = sliders;
        look = { ...look, sun: directionOf(Number(azimuth.value), Number(elevation.value), upOf(look.camera)) };
        slider.parentElement.querySelector('output').value = `${Number(slider.value).toFixed(1)}\u00b0`;
        send();
    });
}

picture.addEventListener('pointerdown', (event) => picture.setPointerCapture(event.pointerId));
picture.addEventListener('pointermove', (event) => {
    if (!picture.hasPointerCapture(event.pointerId)) return;
    const [x, y] = [event.movementX, event.movementY];
    change(event.shiftKey ? shifted(look.camera, x / picture.clientHeight, y / picture.clientHeight)
        : turned(look.camera, x * TURN, y * TURN));
});
picture.addEventListener('wheel', (event) => {
    event.preventDefault();
    change(approached(look.camera, Math.exp(Math.sign(event.deltaY) * 0.1)));
}, { passive: false });
const keys = {
    ArrowLeft: (camera) => turned(camera, KEY_TURN, 0),
    ArrowRight: (camera) => turned(camera, -KEY_TURN, 0),
    ArrowUp: (camera) => turned(camera, 0, KEY_TURN),
    ArrowDown: (camera) => turned(camera, 0, -KEY_TURN),
    '+': (camera) => approached(camera, 0.9),
    '-': (camera) => approached(camera, 1 / 0.9),
};
document.addEventListener('keydown', (event) => {
    const act = keys[event.key];
    // A slider has its own use for arrow keys, and a browser for + and - with others.
    if (!act || event.target.matches?.('input') || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    change(act(look.camera));
});

document.querySelector('#reset').addEventListener('click', () => {
    look = shown.original;
    showSun();
    send();
});
document.querySelector('#copy').addEventListener('click', async () => {
    try {
        await navigator.clipboard.writeText(JSON.stringify(look, null, 2));
        copied.textContent = 'Copied.';
    } catch {
        copied.textContent = 'The browser does not let the page copy.';
    }
});

async function follow() {
    let number = { look: 0, frame: 0 };
    for (;;) {
        try {
            const answer = await fetch(`frame?look=${number.look}&frame=${number.frame}`);
            if (answer.status === 204) continue;
            if (!answer.ok) throw new Error(`status ${answer.status}`);
            number = { look: answer.headers.get('clerestory-look'), frame: answer.headers.get('clerestory-frame') };
            if (problem.dataset.isSilence) problem.textContent = '';
            delete problem.dataset.isSilence;
            if (Number(number.look) > known && !isSending) {
                // Another page has moved it.
                known = Number(number.look);
                look = (await (await fetch('look')).json()).look;
                showSun();
            }
            const samples = Number(answer.headers.get('clerestory-samples'));
            const before = picture.src;
            picture.src = URL.createObjectURL(await answer.blob());
            await picture.decode();
            URL.revokeObjectURL(before);
            picture.dataset.look = number.look;
            picture.dataset.samples = samples;
            progress.textContent = samples === 0 ? 'Coarse' : `${samples} of ${shown.most_samples} samples a pixel`;
        } catch {
            problem.textContent = 'Clerestory does not answer.';
            problem.dataset.isSilence = 'yes';
            // What answers next may count anew.
            number = { look: 0, frame: 0 };
            known = 0;
            await new Promise((resolve) => setTimeout(resolve, RETRY));
        }
    }
}

shown = await (await fetch('look')).json();
look = shown.look;
document.title = shown.name;
document.querySelector('#name').textContent = shown.name;
picture.width = shown.width;
picture.height = shown.height;
showSun();
follow();
