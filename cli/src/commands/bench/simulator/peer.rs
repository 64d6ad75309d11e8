//! The peer: IR-SIM from PyPI, where a Python that has it can be found.

use super::row::Measured;
use std::process::Command;

/// Names the Python that has `irsim`.
const VARIABLE: &str = "SINEW_PEER_PYTHON";
const SCRIPT: &str = include_str!("peer_ir_sim.py");

/// Runs 50 robots with 180 beams in it; or why not.
pub fn ir_sim(seconds: f64) -> Result<Measured, String> {
    let python = std::env::var(VARIABLE).unwrap_or_else(|_| "python3".into());
    let have = Command::new(&python).args(["-c", "import irsim"]).output();
    match have {
        Err(e) => return Err(format!("{python} does not start: {e}")),
        Ok(output) if !output.status.success() => {
            return Err(format!(
                "{python} has no module irsim; `python3 -m venv VENV && VENV/bin/pip install ir-sim` and \
                 {VARIABLE}=VENV/bin/python"
            ));
        }
        Ok(_) => {}
    }
    let folder = std::env::temp_dir().join(format!("sinew-peer-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let output = Command::new(&python)
        .args(["-c", SCRIPT, &seconds.to_string()])
        .current_dir(&folder)
        .env("MPLBACKEND", "Agg")
        .output()
        .map_err(|e| e.to_string());
    let _ = std::fs::remove_dir_all(&folder);
    let output = output?;
    // It prints a banner of its own first.
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().rev().find(|line| line.starts_with('{'));
    let line = line.ok_or_else(|| {
        let error = String::from_utf8_lossy(&output.stderr);
        format!("it failed: {}", error.lines().last().unwrap_or("it printed nothing"))
    })?;
    serde_json::from_str(line).map_err(|e| format!("it printed {line:?}: {e}"))
}
