// The panel beside the map: episode, counts, driver, connection. It only displays.

const ARROWS = { north: "↑", east: "→", south: "↓", west: "←", wait: "wait" };
const HINTS = {
  directions: "The robot drives in a direction while its arrow key is held. M: velocity.",
  velocity: "Arrow keys drive and turn while held; up is forward. M: directions.",
};
const PHASES = {
  starting: "starting …", running: "", ended: "",
};
const OUTCOMES = { timeout: "timed out, not kept; save keeps it" };
const NOTICES_SHOWN = 3;

export class Panel {
  constructor() {
    const ids = [...document.querySelectorAll("[id]")].map((element) => [element.id, element]);
    this.parts = Object.fromEntries(ids);
  }

  show(state, { drives, held }) {
    const { parts } = this;
    const { episode, guard, mux, recorder, world } = state;
    const number = episode.number === null ? "" : ` ${episode.number}`;
    const { outcome } = episode;
    const ended = episode.phase === "ended";
    const what = ended ? OUTCOMES[outcome] ?? outcome : PHASES[episode.phase];
    const running = episode.phase === "running";
    parts.phase.textContent = episode.other_driver
      ? `${episode.other_driver} is driving`
      : episode.phase === "idle" ? "no episode" : [`episode${number}`, what].filter(Boolean).join(" · ");
    const watches = document.body.classList.contains("watching");
    parts.recording.hidden = watches ? recorder?.recording !== "True" : !running;
    parts.teaches.hidden = !state.next_start || running;
    parts.duration.textContent = episode.duration_s.toFixed(1);
    parts.decisions.textContent = `${episode.decisions} decision${episode.decisions === 1 ? "" : "s"}`;
    parts.speed.textContent = `${Math.abs(world?.robot[3] ?? 0).toFixed(1)} m/s`;
    for (const count of ["kept", "arrived", "discarded"]) parts[count].textContent = episode[count];
    const free = drives && !episode.other_driver;
    parts.start.disabled = !free || running || episode.phase === "starting";
    parts.save.disabled = !free || !(running || (ended && outcome === "timeout"));
    const kept = ended && !["discarded", "timeout"].includes(outcome);
    parts.discard.disabled = !free || !(running || kept);
    if (watches) parts.driver.textContent = "read only";
    else this.showDriving(state, drives, held);
    this.showHealth(mux, recorder);
    this.showGuard(guard);
  }

  showDriving(state, drives, held) {
    const { parts } = this;
    for (const mode of ["directions", "velocity"]) {
      parts[mode].setAttribute("aria-pressed", String(state.mode === mode));
    }
    const byDirections = state.mode === "directions";
    parts.choice.textContent = byDirections ? ARROWS[state.choice] : "";
    parts.choice.style.fontSize = state.choice === "wait" ? "" : "22px";
    parts.hint.textContent = HINTS[state.mode];
    for (const button of parts.pad.querySelectorAll("[data-direction]")) {
      const { direction } = button.dataset;
      button.classList.toggle("held", byDirections ? direction === state.choice : held.includes(direction));
    }
    const active = state.mux?.active;
    const driver = drives ? "this page drives" : state.page ? "another page drives" : "no driver";
    parts.driver.textContent = active ? `${driver} · ${active}` : driver;
  }

  showHealth(mux, recorder) {
    const { parts } = this;
    this.showStop(mux?.e_stop === "True");
    const isRecording = recorder?.recording === "True";
    parts.recorder.classList.toggle("alarm", !isRecording && !document.body.classList.contains("watching"));
    parts.recorder.textContent = isRecording
      ? `${Number(recorder.messages).toLocaleString("en")} messages · ${gigabytes(recorder.free_mb)} free`
      : recorder ? "NOT RECORDING" : "no recorder";
  }

  // Changed only when it changes: a screen reader announces every change.
  showStop(engaged) {
    const { stop, alarm } = this.parts;
    if (stop.classList.contains("engaged") === engaged) return;
    stop.classList.toggle("engaged", engaged);
    stop.innerHTML = engaged ? "RELEASE <kbd>R</kbd>" : "E-STOP <kbd>Space</kbd>";
    alarm.textContent = engaged ? "Emergency stop. R releases it." : "Emergency stop released.";
  }

  showGuard(guard) {
    const line = this.parts.guard;
    const overridden = guard?.overridden === "True";
    line.classList.toggle("alarm", !guard || overridden);
    line.textContent = !guard ? "no guard" : overridden ? "guard OVERRIDDEN"
      : guard.action === "DO_NOTHING" ? "guard (hold G to override)" : `guard ${guard.action}: ${guard.reasons}`;
  }

  showLink({ isAlive, isStale }) {
    const { link } = this.parts;
    link.classList.toggle("good", isAlive && !isStale);
    link.classList.toggle("bad", !isAlive);
    link.textContent = !isAlive ? "no connection" : isStale ? "no data from the robot" : "connected";
  }

  showGamepad(name) {
    this.parts.gamepad.hidden = !name;
    this.parts.gamepad.textContent = name ? `gamepad: ${name.slice(0, 28)}` : "";
  }

  addNotice(text) {
    const line = document.createElement("li");
    line.textContent = text;
    this.parts.notices.prepend(line);
    while (this.parts.notices.children.length > NOTICES_SHOWN) this.parts.notices.lastChild.remove();
  }

  veil(title, text) {
    if (this.parts["veil-title"].textContent === title) return;
    this.parts.veil.hidden = !title;
    this.parts["veil-title"].textContent = title;
    this.parts["veil-text"].textContent = text;
  }
}

function gigabytes(megabytes) {
  return `${(Number(megabytes) / 1000).toFixed(1)} GB`;
}
