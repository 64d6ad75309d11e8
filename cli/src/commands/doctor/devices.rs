//! Serial ports, and who else grabs or delays them.

use super::Finding;
use super::machine::Machine;
use rustix::fs::Access;

/// All about devices.
pub fn look(machine: &Machine) -> Vec<Finding> {
    let ports = ports(machine);
    let mut findings = vec![modem_manager(machine, !ports.is_empty())];
    if ports.is_empty() {
        findings.push(Finding::ok("serial ports", "none here; robots can be simulated, or reached over TCP"));
        return findings;
    }
    for port in &ports {
        let allowed = rustix::fs::access(machine.path(port), Access::READ_OK | Access::WRITE_OK).is_ok();
        findings.push(permission(port, &stable_name(machine, port), allowed));
        findings.extend(latency(machine, port));
    }
    findings
}

/// USB serial ports; built-in ones are mostly not there even where the kernel lists them.
fn ports(machine: &Machine) -> Vec<String> {
    let names = machine.names("/dev").into_iter();
    names
        .filter(|name| name.starts_with("ttyUSB") || name.starts_with("ttyACM"))
        .map(|name| format!("/dev/{name}"))
        .collect()
}

/// The name that stays when the port is plugged in elsewhere.
fn stable_name(machine: &Machine, port: &str) -> Option<String> {
    let folder = "/dev/serial/by-id";
    let names = machine.names(folder).into_iter();
    let end = port.rsplit('/').next()?.to_owned();
    let found = names.into_iter().find(|name| {
        let target = std::fs::read_link(machine.path(&format!("{folder}/{name}")));
        target.is_ok_and(|target| target.file_name().is_some_and(|file| *file == *end))
    })?;
    Some(format!("{folder}/{found}"))
}

fn permission(port: &str, stable: &Option<String>, allowed: bool) -> Finding {
    let name = "serial port";
    let found = match stable {
        Some(stable) => format!("{port}, better named {stable}: that name stays"),
        None => port.to_owned(),
    };
    match allowed {
        true => Finding::ok(name, found),
        false => Finding::fail(
            name,
            format!("{found}: this user may not read and write it"),
            "as root: usermod -aG dialout $USER, then log in anew",
        ),
    }
}

/// FTDI chips hold bytes back for 16 ms unless they are told otherwise.
fn latency(machine: &Machine, port: &str) -> Option<Finding> {
    let end = port.rsplit('/').next()?;
    let file = format!("/sys/bus/usb-serial/devices/{end}/latency_timer");
    let ms: u32 = machine.text(&file)?.trim().parse().ok()?;
    let name = "FTDI latency";
    Some(match ms {
        0..=1 => Finding::ok(name, format!("{end} hands bytes over after {ms} ms")),
        _ => Finding::warn(
            name,
            format!("{end} holds bytes back for up to {ms} ms"),
            format!("as root: echo 1 > {file}\nfor good: a udev rule with ATTR{{latency_timer}}=\"1\""),
        ),
    })
}

fn modem_manager(machine: &Machine, ports: bool) -> Finding {
    let name = "ModemManager";
    match machine.has_process("ModemManager") {
        false => Finding::ok(name, "does not run: nobody talks to new serial ports"),
        true => {
            let urgent = if ports { "" } else { " (there is none at present)" };
            Finding::warn(
                name,
                format!("runs: it sends modem commands to every new serial port{urgent}"),
                "as root: systemctl disable --now ModemManager, or a udev rule with ENV{ID_MM_DEVICE_IGNORE}=\"1\"",
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::machine::fake;
    use super::*;

    #[test]
    fn a_port_is_named_by_what_stays() {
        let machine = fake("serial", &[("/dev/ttyUSB0", ""), ("/dev/serial/by-id/x", "")]);
        let link = machine.path("/dev/serial/by-id/usb-FTDI_A1");
        std::os::unix::fs::symlink("../../ttyUSB0", link).unwrap();
        assert_eq!(ports(&machine), ["/dev/ttyUSB0"]);
        assert_eq!(stable_name(&machine, "/dev/ttyUSB0").as_deref(), Some("/dev/serial/by-id/usb-FTDI_A1"));
        assert_eq!(permission("/dev/ttyUSB0", &None, false).verdict, Verdict::Fail);
    }

    #[test]
    fn an_ftdi_chip_that_waits_is_found_with_the_file_that_mends_it() {
        let file = "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer";
        let slow = latency(&fake("ftdi", &[(file, "16\n")]), "/dev/ttyUSB0").unwrap();
        assert_eq!(slow.verdict, Verdict::Warn);
        assert!(slow.remedy.contains(file), "{slow:?}");
        assert_eq!(latency(&fake("ftdi-fast", &[(file, "1")]), "/dev/ttyUSB0").unwrap().verdict, Verdict::Ok);
        assert_eq!(latency(&fake("no-ftdi", &[]), "/dev/ttyUSB0"), None);
    }

    #[test]
    fn a_running_modem_manager_is_found() {
        let machine = fake("modem", &[("/proc/12/comm", "ModemManager\n"), ("/proc/self/comm", "sinew\n")]);
        assert_eq!(modem_manager(&machine, true).verdict, Verdict::Warn);
        assert_eq!(modem_manager(&fake("no-modem", &[("/proc/12/comm", "bash\n")]), true).verdict, Verdict::Ok);
    }
}
