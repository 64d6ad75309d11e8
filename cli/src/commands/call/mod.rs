//! `sinew call`: asks a node, by the layouts that the node itself tells.

mod request;

use crate::exit::{FAILED, Failure, NOT_RUNNING, USAGE};
use crate::live::Which;
use crate::output::{Align, Cell, Out, Paint, Table, Tone, message_lines, parse_seconds, span};
use messages::{Field, Schema};
use runtime::calls::client::{Client, Reply, Request, Update};
use runtime::calls::{CallError, Command, CommandKind, Layout};
use runtime::clock;
use runtime::robot::nearest_advice;
use serde_json::{Value, json};

/// Gives a node a command; without a command shows those that it knows
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The node, as in /drivers/base, or base where only one is called so
    path: String,
    /// The command
    command: Option<String>,
    /// Its message: JSON, or FIELD=VALUE for each field, or the bare value where there is one field
    #[arg(value_name = "MESSAGE", allow_negative_numbers = true)]
    message: Vec<String>,
    /// How long the node has to answer, or to accept a long order
    #[arg(long, value_name = "TIME", default_value = "2s")]
    timeout: String,
    /// The node serves higher numbers first
    #[arg(long, value_name = "0..255", default_value_t = 128)]
    priority: u8,
    /// Prints JSON, an object per line
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// Commands that every node answers, and what they are.
const BUILT_IN: [(&str, &str); 2] = [("ping", "who answers, and how fast"), ("state", "what the node says of itself")];

/// Calls.
pub fn run(args: Args) -> Result<(), Failure> {
    let timeout_s = parse_seconds(&args.timeout).map_err(|reason| Failure::new(USAGE, reason))?;
    let robot = args.which.find()?;
    let node = robot.resolve_node(&args.path)?;
    let mut client = Client::connect(&robot.folder, &node, "sinew call").map_err(failure)?;
    let mut out = Out::stdout();
    match &args.command {
        None => list(&mut client, &node, &args, &mut out)?,
        Some(command) => give(&mut client, &node, command, timeout_s, &args, &mut out)?,
    }
    out.flush()
}

/// A call's error as the command's.
pub fn failure(error: CallError) -> Failure {
    let code = match error {
        CallError::NodeNotRunning { .. } | CallError::Died { .. } => NOT_RUNNING,
        CallError::Unknown { .. } | CallError::Target(_) => USAGE,
        _ => FAILED,
    };
    Failure::new(code, error.to_string())
}

fn list(client: &mut Client, node: &str, args: &Args, out: &mut Out) -> Result<(), Failure> {
    let names = client.describe().map_err(failure)?;
    let mut commands = Vec::new();
    for name in &names.commands {
        commands.push(client.describe_command(&name.name).map_err(failure)?);
    }
    if args.json {
        let commands: Result<Vec<Value>, Failure> = commands.iter().map(command_json).collect();
        return out.json(&json!({"node": node, "commands": commands?, "built_in": names.built_in}));
    }
    let mut table =
        Table::new(&[("COMMAND", Align::Left), ("TAKES", Align::Left), ("ANSWERS", Align::Left), ("", Align::Left)]);
    for command in &commands {
        let takes = schema(&command.request)?;
        let note = if command.kind == CommandKind::Order { "long order" } else { "" };
        table.row([
            Cell::toned(Tone::Name, command.name.as_str()),
            fields(&takes).into(),
            fields(&schema(&command.answer)?).into(),
            Cell::toned(Tone::Dim, [note, takes.doc.as_str()].join(" ").trim()),
        ]);
    }
    for (name, about) in BUILT_IN {
        table.row([Cell::toned(Tone::Dim, name), "".into(), "".into(), Cell::toned(Tone::Dim, about)]);
    }
    out.line(format!("{} {}", out.paint.strong(node), out.paint.dim("answers")))?;
    out.table(&table)
}

fn command_json(command: &Command) -> Result<Value, Failure> {
    let layout = |layout: &Layout| serde_json::from_str::<Value>(&layout.schema).unwrap_or(Value::Null);
    Ok(json!({
        "name": command.name,
        "kind": command.kind,
        "request": layout(&command.request),
        "progress": command.progress.as_ref().map(layout),
        "answer": layout(&command.answer),
    }))
}

fn schema(layout: &Layout) -> Result<Schema, Failure> {
    Schema::from_text(&layout.schema).map_err(|e| Failure::from(format!("the node describes itself badly: {e}")))
}

/// The fields of a message in one line: `on [0/1], x_m`.
fn fields(schema: &Schema) -> String {
    let one = |field: &Field| match field.values.is_empty() {
        true => field.name.clone(),
        false => format!("{} ({})", field.name, field.values.join("|")),
    };
    let asked: Vec<String> = schema.fields.iter().filter(|field| !request::is_filler(field)).map(one).collect();
    if asked.is_empty() { "nothing".into() } else { asked.join(", ") }
}

fn give(
    client: &mut Client,
    node: &str,
    command: &str,
    timeout_s: f64,
    args: &Args,
    out: &mut Out,
) -> Result<(), Failure> {
    let built_in = BUILT_IN.iter().any(|(name, _)| *name == command);
    let described = match built_in {
        true => None,
        false => Some(client.describe_command(command).map_err(|e| unknown(client, node, command, e))?),
    };
    let (layout_hash, body) = match &described {
        Some(described) => {
            (described.request.hash, request::body(&schema(&described.request)?, &args.message, node, command)?)
        }
        None if args.message.is_empty() => (0, Vec::new()),
        None => return Err(Failure::new(USAGE, format!("\"{command}\" takes no message"))),
    };
    let progress_schema = described.as_ref().and_then(|d| d.progress.as_ref()).map(schema).transpose()?;
    let begun = clock::now();
    let request = Request { command, layout_hash, body: &body, priority: args.priority, timeout_s };
    let mut broken = None;
    let reply = client.call_with(&request, |update| {
        let said = said(update, progress_schema.as_ref(), args.json, out.paint);
        if let Err(failure) = out.line(said).and_then(|()| out.flush()) {
            broken = Some(failure);
        }
    });
    if let Some(failure) = broken {
        return Err(failure);
    }
    let reply = reply.map_err(failure)?;
    let took_s = clock::now().since(begun);
    let answer_schema = described.as_ref().map(|described| schema(&described.answer)).transpose()?;
    let answer = decode(&reply, answer_schema.as_ref());
    if args.json {
        return out.json(&json!({"node": node, "command": command, "answer": answer, "took_s": took_s}));
    }
    out.line(format!("{} {}", out.paint.tone(Tone::Good, "done"), out.paint.dim(format!("after {}", span(took_s)))))?;
    match answer_schema {
        Some(schema) => message_lines(&schema, &answer, out.paint).iter().try_for_each(|line| out.line(line)),
        None => out.line(serde_json::to_string_pretty(&answer)?),
    }
}

/// An unknown command, with the one that was probably meant.
fn unknown(client: &mut Client, node: &str, command: &str, error: CallError) -> Failure {
    let CallError::Unknown { .. } = error else { return failure(error) };
    let Ok(known) = client.describe() else { return failure(error) };
    let names: Vec<String> = known.commands.into_iter().map(|c| c.name).chain(known.built_in).collect();
    Failure::new(USAGE, format!("{node} has no command \"{command}\"; {}", nearest_advice(command, &names)))
}

fn said(update: Update<'_>, schema: Option<&Schema>, json: bool, paint: Paint) -> String {
    match (update, schema) {
        (Update::Accepted, _) if json => json!({"accepted": true}).to_string(),
        (Update::Accepted, _) => paint.dim("accepted; Ctrl-C cancels"),
        (Update::Progress { body, .. }, Some(schema)) => {
            let message = schema.to_json(body, &[]);
            match json {
                true => json!({"progress": message}).to_string(),
                false => format!("{} {}", paint.dim("progress"), in_one_line(schema, &message)),
            }
        }
        (Update::Progress { .. }, None) => paint.dim("progress"),
    }
}

fn in_one_line(schema: &Schema, message: &Value) -> String {
    let one =
        |line: crate::output::FieldLine| format!("{} {} {}", line.name, line.value, line.unit).trim_end().to_owned();
    crate::output::field_lines(schema, message).into_iter().map(one).collect::<Vec<_>>().join("  ")
}

fn decode(reply: &Reply, schema: Option<&Schema>) -> Value {
    match schema {
        Some(schema) if reply.layout_hash != 0 => schema.to_json(&reply.body, &[]),
        _ => serde_json::from_slice(&reply.body).unwrap_or(Value::Null),
    }
}
