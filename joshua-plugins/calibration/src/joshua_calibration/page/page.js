"use strict";

// The page shows what the server sends and asks for what a person presses; it decides nothing by itself.

const ORDER = ["homing", "sweep", "review", "write", "done"];
const STATES = { waiting: "", active: "move it", complete: "complete", done: "done", refused: "again" };
const byId = (id) => document.getElementById(id);
const rows = [];
let board = null;

function ask(what, joint = -1) {
  fetch("ask", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ ask: what, joint }),
  }).catch(() => lost());
}

function show(next) {
  board = next;
  const view = board.view;
  byId("title").textContent = board.title;
  document.title = `${board.arms[board.arm][0]} – calibration`;
  byId("arms").replaceChildren(...board.arms.map(([name, state]) => {
    const item = document.createElement("li");
    item.textContent = name;
    item.className = state;
    if (state === "active") item.setAttribute("aria-current", "true");
    return item;
  }));
  const at = ORDER.indexOf(view.step);
  for (const item of byId("steps").children) {
    const place = ORDER.indexOf(item.dataset.step);
    item.className = place < at ? "past" : place === at ? "now" : "";
    item.toggleAttribute("aria-current", place === at);
  }
  byId("pose").hidden = view.step !== "homing" || Boolean(board.ended);
  setText(byId("instruction"), board.ended || view.instruction);
  const message = byId("message");
  setText(message, board.ended ? "" : view.message);
  message.hidden = !message.textContent;
  message.className = view.is_problem ? "problem" : "";
  const over = Boolean(board.ended);
  byId("confirm").disabled = over || !view.commands.includes("confirm");
  byId("confirm").className = view.ready && !over ? "primary" : "";
  byId("confirm").firstChild.data = view.step === "review" ? "Write the calibration " : "Confirm ";
  byId("back").hidden = over || !view.commands.includes("back");
  byId("quit").hidden = over;
  showJoints(view, over);
}

function showJoints(view, over) {
  while (rows.length > view.joints.length) rows.pop().remove();
  while (rows.length < view.joints.length) {
    const index = rows.length;
    const row = byId("joint").content.firstElementChild.cloneNode(true);
    row.querySelector(".repeat").addEventListener("click", () => ask("repeat", index));
    byId("joints").append(row);
    rows.push(row);
  }
  view.joints.forEach((joint, index) => showJoint(rows[index], joint, index, view, over));
}

function showJoint(row, joint, index, view, over) {
  row.className = joint.state;
  row.toggleAttribute("aria-current", view.active === index);
  setText(row.querySelector(".number"), String(index + 1));
  setText(row.querySelector(".name"), joint.name);
  setText(row.querySelector(".low"), degrees(joint.low_deg));
  setText(row.querySelector(".now"), degrees(joint.present_deg));
  setText(row.querySelector(".high"), degrees(joint.high_deg));
  const covered = joint.state === "active" && joint.low_deg !== null ? ends(joint) : STATES[joint.state];
  setText(row.querySelector(".state"), joint.note || covered);
  const bar = row.querySelector(".bar");
  bar.style.setProperty("--now", place(joint.present_deg));
  bar.style.setProperty("--low", place(joint.low_deg));
  bar.style.setProperty("--high", place(joint.high_deg));
  const range = bar.querySelector(".range");
  range.classList.toggle("low-found", joint.low_found);
  range.classList.toggle("high-found", joint.high_found);
  range.hidden = joint.low_deg === null;
  bar.querySelector(".needle").hidden = joint.present_deg === null;
  bar.setAttribute("aria-label",
    `${joint.name} at ${degrees(joint.present_deg)}, range ${degrees(joint.low_deg)} to ${degrees(joint.high_deg)}`);
  const repeat = row.querySelector(".repeat");
  repeat.hidden = over || !view.commands.includes("repeat") || joint.low_deg === null;
  repeat.setAttribute("aria-label", `Repeat ${joint.name}`);
}

function ends(joint) {
  const missing = Number(!joint.low_found) + Number(!joint.high_found);
  return missing ? `${missing} end${missing > 1 ? "s" : ""} open` : "move it";
}

function degrees(value) {
  return value === null ? "–" : `${value < 0 ? "−" : ""}${Math.abs(value).toFixed(1)}°`;
}

function place(value) {
  return `${Math.min(100, Math.max(0, (value ?? 0) / 3.6 + 50))}%`;
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function lost() {
  if (board && board.ended) return;
  setText(byId("message"), "The program no longer answers. See the terminal in which it was started.");
  byId("message").hidden = false;
  byId("message").className = "problem";
  byId("confirm").disabled = true;
}

byId("confirm").addEventListener("click", () => ask("confirm"));
byId("back").addEventListener("click", () => ask("back"));
byId("quit").addEventListener("click", () => {
  if (window.confirm("Stop the calibration? The old one is still used.")) ask("quit");
});
document.addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
  const onButton = event.target instanceof HTMLButtonElement;
  if (event.key === "Enter" && !onButton && !byId("confirm").disabled) ask("confirm");
  else if (event.key === "b" && !byId("back").hidden) ask("back");
  else if (/^[1-9]$/.test(event.key) && rows[event.key - 1] && !byId("back").hidden) ask("repeat", event.key - 1);
  else return;
  event.preventDefault();
});

const events = new EventSource("events");
events.onmessage = (event) => {
  show(JSON.parse(event.data));
  if (board.ended) events.close();
};
events.onerror = lost;
