// The page of a scene in a cell of a notebook. Its state and the model's follow each other.
const NAMES = ["params", "time", "playing", "view", "orbit", "pan"];

export default {
  render({ model, el }) {
    const frame = document.createElement("iframe");
    const [width, height] = model.get("size");
    frame.style.cssText = `width: 100%; max-width: ${width}px; height: ${height}px; border: 0`;
    frame.allow = "fullscreen";
    frame.srcdoc = model.get("page");

    let ready = false, taking = false;
    const send = (names) => {
      if (!ready || taking) return;
      const state = Object.fromEntries(names.map((name) => [name, model.get(name)]));
      frame.contentWindow.postMessage({ raymarch: state }, "*");
    };
    const receive = (event) => {
      if (event.source !== frame.contentWindow || !event.data?.raymarch) return;
      if (event.data.raymarch === "panel") {  // it is below the picture, which keeps its size
        frame.style.height = `${height + event.data.height}px`;
        return;
      }
      if (event.data.raymarch === "ready") {
        ready = true;
        send(NAMES);
        return;
      }
      taking = true;
      for (const name of NAMES) model.set(name, event.data.raymarch[name]);
      taking = false;
      model.save_changes();
    };
    const follow = NAMES.map((name) => [`change:${name}`, () => send([name])]);

    window.addEventListener("message", receive);
    for (const [event, act] of follow) model.on(event, act);
    el.append(frame);
    for (const still of document.getElementsByClassName(model.get("still"))) still.style.display = "none";
    return () => {
      window.removeEventListener("message", receive);
      for (const [event, act] of follow) model.off(event, act);
    };
  },
};
