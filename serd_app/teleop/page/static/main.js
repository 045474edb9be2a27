// Connects the link to the server, the map, the panel and the controls.

import { Controls } from "./controls.js";
import { Link } from "./link.js";
import { Overlay } from "./overlay.js";
import { Panel } from "./panel.js";
import { View } from "./view.js";

const panel = new Panel();
const view = new View(document.getElementById("view"));
const overlay = new Overlay(view, press);
let ownPage = 0;
let state = null;
let lastNumber = null;
let frame = 0;
let controls = null; // none on a page that only watches

const handlers = {
  hello: (message) => { ownPage = message.page; },
  scene: (message) => {
    overlay.take(null);
    view.setScene(message);
    document.getElementById("scene-name").textContent = message.name;
    if (message.watch) watch();
    else controls ??= new Controls({ link, actions, pad: document.getElementById("pad") });
  },
  overlay: (message) => overlay.take(message),
  notice: (message) => panel.addNotice(message.text),
  state: (message) => {
    state = message;
    if (controls) controls.mode = message.mode;
    if (message.episode.number !== lastNumber) view.clearTrail();
    lastNumber = message.episode.number;
    view.update(message);
    // Once per frame: a page that is slower than the messages skips states and is not late.
    frame ||= requestAnimationFrame(showState);
  },
};

function showState() {
  frame = 0;
  view.draw();
  panel.show(state, { drives: state.page === ownPage, held: controls?.held ?? [] });
  panel.showGamepad(controls?.gamepadName);
}

function watch() {
  document.body.classList.add("watching");
  document.title = "SERD · watch";
}

const link = new Link({
  onMessage: (message) => handlers[message.type]?.(message),
  onChange: showConnection,
});

// A second click soon after the one that stopped is an accident, no release.
const RELEASABLE_MS = 1000;
let stoppedMs = -Infinity;
const releaseByClick = () => {
  if (performance.now() - stoppedMs > RELEASABLE_MS) actions.release();
};
const isStopped = () => state?.mux?.e_stop === "True";
const actions = {
  start: () => link.send({ type: "episode", do: "start" }),
  save: () => link.send({ type: "episode", do: "save" }),
  discard: () => link.send({ type: "episode", do: "discard" }),
  stop: () => {
    stoppedMs = performance.now();
    link.send({ type: "e_stop", engaged: true });
  },
  release: () => link.send({ type: "e_stop", engaged: false }),
  switchMode: () => setMode(state?.mode === "directions" ? "velocity" : "directions"),
};
const setMode = (mode) => link.send({ type: "mode", mode });

const part = (id) => document.getElementById(id);
for (const name of ["start", "save", "discard"]) press(part(name), actions[name]);
for (const mode of ["directions", "velocity"]) press(part(mode), () => setMode(mode));
press(part("stop"), () => (isStopped() ? releaseByClick() : actions.stop()));

// After a click by pointer, which gives the focus, Enter is the driver's key again; a click by key keeps it.
function press(button, act) {
  button.addEventListener("click", (event) => {
    act();
    if (event.detail) button.blur();
  });
}

function showConnection() {
  const isAlive = link.isAlive;
  panel.showLink({ isAlive, isStale: state?.is_stale ?? true });
  const watches = !controls;
  if (!isAlive) panel.veil("No connection", watches ? "Reconnecting …" : "The robot has stopped. Reconnecting …");
  else if (watches) panel.veil(state?.world ? "" : "Nothing to see yet", "No robot_pose has come. Is a stack running in this ROS domain?");
  else if (!controls.isInFront) panel.veil("The robot stands", "Click here to drive: this page must have the focus.");
  else if (isStopped()) panel.veil("Emergency stop", "Press R, or Release; then press a direction anew.");
  else panel.veil("", "");
}
