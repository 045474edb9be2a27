// Connects the link to the server, the map, the panel and the controls.

import { Controls } from "./controls.js";
import { Link } from "./link.js";
import { Panel } from "./panel.js";
import { View } from "./view.js";

const panel = new Panel();
const view = new View(document.getElementById("view"));
let ownPage = 0;
let state = null;
let lastNumber = null;
let frame = 0;

const handlers = {
  hello: (message) => { ownPage = message.page; },
  scene: (message) => {
    view.setScene(message);
    document.getElementById("scene-name").textContent = message.name;
  },
  notice: (message) => panel.addNotice(message.text),
  state: (message) => {
    state = message;
    controls.mode = message.mode;
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
  panel.show(state, { drives: state.page === ownPage, held: controls.held });
  panel.showGamepad(controls.gamepadName);
}

const link = new Link({
  onMessage: (message) => handlers[message.type]?.(message),
  onChange: showConnection,
});

const isStopped = () => state?.mux?.e_stop === "True";
const actions = {
  start: () => link.send({ type: "episode", do: "start" }),
  save: () => link.send({ type: "episode", do: "save" }),
  discard: () => link.send({ type: "episode", do: "discard" }),
  stop: () => link.send({ type: "e_stop", engaged: true }),
  release: () => link.send({ type: "e_stop", engaged: false }),
  switchMode: () => setMode(state?.mode === "directions" ? "velocity" : "directions"),
};
const setMode = (mode) => link.send({ type: "mode", mode });
const controls = new Controls({ link, actions, pad: document.getElementById("pad") });

for (const name of ["start", "save", "discard"]) press(name, actions[name]);
for (const mode of ["directions", "velocity"]) press(mode, () => setMode(mode));
press("stop", () => (isStopped() ? actions.release() : actions.stop()));

// A button that keeps the focus would also react to Space and Enter, which are driving keys.
function press(id, act) {
  const button = document.getElementById(id);
  button.addEventListener("click", () => { act(); button.blur(); });
}

function showConnection() {
  const isAlive = link.isAlive;
  panel.showLink({ isAlive, isStale: state?.is_stale ?? true });
  if (!isAlive) panel.veil("No connection", "The robot has stopped. Reconnecting …");
  else if (!controls.isInFront) panel.veil("The robot stands", "Click here to drive: this page must have the focus.");
  else if (isStopped()) panel.veil("Emergency stop", "Press R, or Release; then press a direction anew.");
  else panel.veil("", "");
}
