// The page of `sashimono serve`: sends files, shows jobs, and asks how far they are.

const jobs = document.getElementById("jobs");
const said = document.getElementById("said");
const drop = document.getElementById("drop");
const file = document.getElementById("file");
const rows = new Map();

const STATES = {
  waiting: "waiting", running: "planning", complete: "complete and verified", partial: "partial", failed: "failed",
  cancelled: "cancelled",
};
const STAGES = { sequence: "finding the order", motion: "finding motions", contact: "choosing contacts", verify: "checking", pictures: "drawing instructions" };
const NAMES = { "plan.html": "Open the plan", "manual.html": "Work instructions", "plan.glb": "Animation (GLB)", "plan.json": "plan.json" };

function options() {
  const chosen = Object.fromEntries(new FormData(document.getElementById("options")));
  if (!chosen.unit) delete chosen.unit;
  chosen.hands = Number(chosen.hands) || 2;
  return chosen;
}

async function ask(path, request) {
  const answer = await fetch(path, request);
  const text = await answer.text();
  let value;
  try { value = JSON.parse(text); } catch { value = { error: text }; }
  if (!answer.ok) throw new Error(value.error || answer.statusText);
  return value;
}

async function send(files) {
  said.textContent = "";
  for (const each of files) {
    const query = new URLSearchParams({ name: each.name, options: JSON.stringify(options()) });
    try {
      await ask(`api/jobs?${query}`, { method: "POST", body: each });
    } catch (error) {
      said.textContent = error.message;
    }
    await refresh();
  }
  file.value = "";
}

function row(job) {
  const item = document.getElementById("row").content.firstElementChild.cloneNode(true);
  const form = item.querySelector(".again");
  const text = form.querySelector("textarea");
  item.querySelector("h3").textContent = job.name;
  item.querySelector(".change").addEventListener("click", async () => {
    form.hidden = !form.hidden;
    if (!form.hidden && !text.value) text.value = await (await fetch(`api/jobs/${job.id}/constraints`)).text();
    if (!form.hidden) text.focus();
  });
  item.querySelector(".remove").addEventListener("click", () => act(`api/jobs/${job.id}`, { method: "DELETE" }));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    form.hidden = true;
    const body = JSON.stringify({ ...options(), constraints: text.value });
    act(`api/jobs/${job.id}/again`, { method: "POST", body });
  });
  return item;
}

async function act(path, request) {
  said.textContent = "";
  try { await ask(path, request); } catch (error) { said.textContent = error.message; }
  await refresh();
}

function show(item, job) {
  const running = job.state === "running";
  const over = ["complete", "partial", "failed", "cancelled"].includes(job.state);
  item.dataset.state = job.state;
  const seconds = job.finished && job.started ? `, ${Math.round(job.finished - job.started)} s` : "";
  item.querySelector(".state").textContent = STATES[job.state] + (job.state === "complete" ? seconds : "");
  const stage = running ? STAGES[job.stage] || job.stage || "reading" : job.message;
  item.querySelector(".message").textContent = running && job.total ? `${stage}: ${job.done} of ${job.total}` : stage;
  const bar = item.querySelector("progress");
  bar.hidden = !running;
  bar.setAttribute("aria-label", `Progress of ${job.name}`);
  if (job.total) bar.value = job.done / job.total; else bar.removeAttribute("value");
  const remove = item.querySelector(".remove");
  remove.textContent = over ? "Remove" : "Cancel";
  remove.setAttribute("aria-label", `${remove.textContent} ${job.name}`);
  const links = item.querySelector(".links");
  if (links.childElementCount !== job.files.length) {
    const order = Object.keys(NAMES);
    const rank = (name) => (order.indexOf(name) + 99) % 99;
    links.replaceChildren(...[...job.files].sort((a, b) => rank(a) - rank(b)).map((name) => {
      const link = document.createElement("a");
      link.href = `jobs/${job.id}/${name.split("/").map(encodeURIComponent).join("/")}`;
      link.textContent = NAMES[name] || name;
      link.className = name === "plan.html" ? "first" : "";
      if (name.endsWith(".html")) { link.target = "_blank"; link.rel = "noopener"; } else link.download = `${job.name}.${name}`;
      return link;
    }));
  }
}

async function refresh() {
  const found = await ask("api/jobs");
  const known = new Set(found.map((job) => job.id));
  for (const [id, item] of rows) if (!known.has(id)) { item.remove(); rows.delete(id); }
  found.forEach((job, k) => {
    if (!rows.has(job.id)) rows.set(job.id, row(job));
    const item = rows.get(job.id);
    show(item, job);
    if (jobs.children[k] !== item) jobs.insertBefore(item, jobs.children[k] || null);
  });
  document.getElementById("none").hidden = found.length > 0;
  return found.some((job) => job.state === "waiting" || job.state === "running");
}

async function watch() {
  let busy = true;
  try { busy = await refresh(); if (said.textContent === LOST) said.textContent = ""; } catch { said.textContent = LOST; }
  setTimeout(watch, busy ? 700 : 3000);
}
const LOST = "The server does not answer. Start it again: jobs are kept.";

file.addEventListener("change", () => send(file.files));
for (const kind of ["dragenter", "dragover"]) drop.addEventListener(kind, (event) => { event.preventDefault(); drop.classList.add("over"); });
for (const kind of ["dragleave", "drop"]) drop.addEventListener(kind, () => drop.classList.remove("over"));
document.addEventListener("dragover", (event) => event.preventDefault());
document.addEventListener("drop", (event) => { event.preventDefault(); send(event.dataTransfer.files); });
watch();
