// The time line of a recording: play and pause, go to a time, change the speed.

const RATES = [0.25, 0.5, 1, 2, 4, 8, 16];

export class Replay {
  constructor(link, { duration_s: duration, episodes }) {
    this.link = link;
    this.duration = duration;
    const part = (id) => document.getElementById(id);
    [this.play, this.time, this.rate, this.shown] = ["play", "time", "rate", "shown-time"].map(part);
    this.isDragged = false;
    part("replay").hidden = false;
    this.time.max = duration;
    this.showEpisodes(part("episodes"), episodes);
    this.play.onclick = () => this.toggle();
    this.time.oninput = () => { this.isDragged = true; this.showTime(Number(this.time.value)); };
    this.time.onchange = () => {
      this.request({ at_s: Number(this.time.value) });
      this.isDragged = false;
    };
    this.rate.onchange = () => this.request({ rate: Number(this.rate.value) });
    document.onkeydown = (event) => {
      if (event.key !== " " || event.target.closest("button, select")) return;
      this.toggle();
      event.preventDefault();
    };
  }

  request(change) { this.link.send({ type: "replay", ...change }); }

  // At the end it begins anew.
  toggle() {
    const atEnd = !this.isPlaying && this.at >= this.duration - 0.1;
    this.request({ playing: !this.isPlaying, ...(atEnd ? { at_s: 0 } : {}) });
  }

  show({ at_s: at, rate, playing }) {
    [this.at, this.isPlaying] = [at, playing];
    this.play.textContent = playing ? "❚❚" : "▶";
    this.play.setAttribute("aria-label", playing ? "Pause" : "Play");
    this.showRate(rate);
    if (this.isDragged) return;
    this.time.value = at;
    this.showTime(at);
  }

  showTime(at) {
    const text = `${minutes(at)} / ${minutes(this.duration)}`;
    this.shown.textContent = text;
    this.time.setAttribute("aria-valuetext", text);
  }

  showRate(rate) {
    if (Number(this.rate.value) === rate) return;
    const rates = [...new Set([...RATES, rate])].sort((one, other) => one - other);
    this.rate.replaceChildren(...rates.map((each) => new Option(`${each} ×`, each, false, each === rate)));
  }

  showEpisodes(line, episodes) {
    line.replaceChildren(...episodes.map(([start, end, outcome]) => {
      const mark = document.createElement("i");
      mark.className = outcome;
      mark.style.left = `${(100 * start) / this.duration}%`;
      mark.style.width = `${(100 * Math.max(0, end - start)) / this.duration}%`;
      return mark;
    }));
  }
}

function minutes(seconds) {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}
