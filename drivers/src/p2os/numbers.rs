//! Numbers of the Pioneer protocol: commands to the microcontroller, packet types from it, bits of its flags.
//!
//! Source: device-family manuals (P2OS, AROS, ARCOS) as two independent open drivers use them.

/// Command numbers (client to robot): the first payload byte.
pub mod command {
    /// Starts the handshake. The same number is [`PULSE`] once the connection is open.
    pub const SYNC0: u8 = 0;
    /// Second step of the handshake; afterwards [`OPEN`].
    pub const SYNC1: u8 = 1;
    /// Third step; its echo carries name, class and subclass. Afterwards [`CLOSE`].
    pub const SYNC2: u8 = 2;
    /// Feeds the watchdog.
    pub const PULSE: u8 = 0;
    /// Starts the SIP cycle.
    pub const OPEN: u8 = 1;
    /// Ends the session: stop, motors off, SIPs off.
    pub const CLOSE: u8 = 2;
    /// Sonar firing order (text: sonar numbers from 1).
    pub const POLLING: u8 = 3;
    /// Motor power 1/0.
    pub const ENABLE: u8 = 4;
    /// Translational acceleration (+) or deceleration (−) [mm/s²].
    pub const SETA: u8 = 5;
    /// Greatest translational speed [mm/s].
    pub const SETV: u8 = 6;
    /// Sets the odometry to zero.
    pub const SETO: u8 = 7;
    /// Translates by that many [mm].
    pub const MOVE: u8 = 8;
    /// The same as [`RVEL`].
    pub const ROTATE: u8 = 9;
    /// Greatest rotational speed [deg/s].
    pub const SETRV: u8 = 10;
    /// Translational velocity [mm/s].
    pub const VEL: u8 = 11;
    /// Turns to an absolute heading [deg].
    pub const HEAD: u8 = 12;
    /// Turns relative to the current heading [deg].
    pub const DHEAD: u8 = 13;
    /// Piezo: pairs of (duration × 20 ms, tone).
    pub const SAY: u8 = 15;
    /// JOYSTICKpac 0 stop, 1 once, 2 each cycle.
    pub const JOYREQUEST: u8 = 17;
    /// Asks for one CONFIGpac.
    pub const CONFIG: u8 = 18;
    /// ENCODERpac 0 stop, 1 once, 2 and more each cycle.
    pub const ENCODER: u8 = 19;
    /// Rotational velocity, counter-clockwise [deg/s].
    pub const RVEL: u8 = 21;
    /// Turns relative to the last heading set-point [deg].
    pub const DCHEAD: u8 = 22;
    /// Rotational acceleration (+) or deceleration (−) [deg/s²].
    pub const SETRA: u8 = 23;
    /// AROS: 0 cancel, 1 simulate low battery, 2 shut the computer down.
    pub const SHUTDOWN: u8 = 25;
    /// Inertial unit of newer models.
    pub const IMUREQUEST: u8 = 26;
    /// Sonar 1 = all on, 0 = all off.
    pub const SONAR: u8 = 28;
    /// Decelerates to a stop; motors stay on.
    pub const STOP: u8 = 29;
    /// Digital outputs: high byte mask, low byte values.
    pub const DIGOUT: u8 = 30;
    /// Power outputs.
    pub const PBIOPORT: u8 = 31;
    /// Wheel speeds; see [`super::super::protocol::pack_wheels`].
    pub const VEL2: u8 = 32;
    /// Gripper.
    pub const GRIPPER: u8 = 33;
    /// Analogue port shown in the SIP; also the old "enable the simulated laser".
    pub const ADSEL: u8 = 35;
    /// Gripper force; also the old "start angle of the simulated laser".
    pub const GRIPPERVAL: u8 = 36;
    /// Gripper packets; also the old "end angle of the simulated laser".
    pub const GRIPREQUEST: u8 = 37;
    /// Gyro calibration, clockwise; also the old "increment of the simulated laser".
    pub const GYROCALCW: u8 = 38;
    /// Gyro calibration, counter-clockwise.
    pub const GYROCALCCW: u8 = 39;
    /// IOpac 0 stop, 1 once, 2 each cycle.
    pub const IOREQUEST: u8 = 40;
    /// Bytes out of AUX1.
    pub const TTY2: u8 = 42;
    /// Bytes in from AUX1.
    pub const GETAUX: u8 = 43;
    /// Bumper stops: 0 never, 1 front, 2 rear, 3 both.
    pub const BUMPSTALL: u8 = 44;
    /// Compass module.
    pub const TCM2: u8 = 45;
    /// Joystick drive.
    pub const JOYDRIVE: u8 = 47;
    /// Milliseconds per ping, 2…120.
    pub const SONARCYCLE: u8 = 48;
    /// Line speed of the host port; see [`BAUDS`](super::BAUDS).
    pub const HOSTBAUD: u8 = 50;
    /// Line speed of AUX1.
    pub const AUX1BAUD: u8 = 51;
    /// Line speed of AUX2.
    pub const AUX2BAUD: u8 = 52;
    /// Line speed of AUX3.
    pub const AUX3BAUD: u8 = 53;
    /// Stops at once, without regard to deceleration limits.
    pub const E_STOP: u8 = 55;
    /// Whether the stop button disables the motors.
    pub const E_STALL: u8 = 56;
    /// Quick stop (one simulator's word for [`E_STOP`]).
    pub const QSTOP: u8 = 57;
    /// GYROpac each cycle.
    pub const GYRO: u8 = 58;
    /// Bytes out of AUX3.
    pub const TTY4: u8 = 60;
    /// Bytes in from AUX3.
    pub const GETAUX3: u8 = 61;
    /// Battery packets of newer models.
    pub const BATTERYINFO: u8 = 62;
    /// Compass calibration.
    pub const CALCOMP: u8 = 65;
    /// Bytes out of AUX2.
    pub const TTY3: u8 = 66;
    /// Bytes in from AUX2.
    pub const GETAUX2: u8 = 67;
    /// Docking mechanism.
    pub const CHARGE: u8 = 68;
    /// First of the arm's commands.
    pub const ARM_FIRST: u8 = 70;
    /// Last of the arm's commands.
    pub const ARM_LAST: u8 = 81;
    /// Rotational gains.
    pub const ROTKP: u8 = 82;
    /// Rotational gains.
    pub const ROTKV: u8 = 83;
    /// Rotational gains.
    pub const ROTKI: u8 = 84;
    /// Translational gains.
    pub const TRANSKP: u8 = 85;
    /// Translational gains.
    pub const TRANSKV: u8 = 86;
    /// Translational gains.
    pub const TRANSKI: u8 = 87;
    /// Encoder ticks per half turn.
    pub const REVCOUNT: u8 = 88;
    /// Difference between the wheels.
    pub const DRIFTFACTOR: u8 = 89;
    /// Plays a stored sound (AmigoBot).
    pub const SOUND: u8 = 90;
    /// Requests the list of sounds.
    pub const PLAYLIST: u8 = 91;
    /// Mutes the piezo with 0.
    pub const SOUNDTOG: u8 = 92;
    /// Encoder ticks per millimetre.
    pub const TICKSMM: u8 = 93;
    /// Sideways velocity of holonomic models [mm/s].
    pub const LATVEL: u8 = 110;
    /// Sideways acceleration of holonomic models [mm/s²].
    pub const LATACCEL: u8 = 113;
    /// Simulators: places the robot (x mm, y mm, heading deg as 4-byte integers).
    pub const SIM_SET_POSE: u8 = 224;
    /// Simulators: back to the start.
    pub const SIM_RESET: u8 = 225;
    /// Simulators: laser 0 off, 1 plain packets, 2 extended.
    pub const SIM_LRF_ENABLE: u8 = 230;
    /// Simulators: start angle of the laser [deg].
    pub const SIM_LRF_SET_FOV_START: u8 = 231;
    /// Simulators: end angle of the laser [deg].
    pub const SIM_LRF_SET_FOV_END: u8 = 232;
    /// Simulators: increment of the laser [deg / 100].
    pub const SIM_LRF_SET_RES: u8 = 233;
    /// Simulators: control text.
    pub const SIM_CTRL: u8 = 236;
    /// Simulators: SIMSTAT 0 off, 1 once, 2 each cycle.
    pub const SIM_STAT: u8 = 237;
    /// Simulators: message to print.
    pub const SIM_MESSAGE: u8 = 238;
    /// Simulators: end.
    pub const SIM_EXIT: u8 = 239;
    /// Pretends a battery voltage [dV]; 0 = the real one.
    pub const BATTEST: u8 = 250;
    /// Restarts the controller.
    pub const RESET: u8 = 253;
    /// Maintenance mode.
    pub const MAINTENANCE: u8 = 255;
}

/// Packet types (robot to client): the first payload byte.
pub mod packet {
    /// SIP types start here; clients accept the whole range up to [`SIP_LAST`].
    pub const SIP_FIRST: u8 = 0x30;
    /// Standard SIP, motors stopped.
    pub const SIP_STOPPED: u8 = 0x32;
    /// Standard SIP, moving.
    pub const SIP_MOVING: u8 = 0x33;
    /// Last type that is read as a SIP.
    pub const SIP_LAST: u8 = 0x34;
    /// Configuration; see [`super::super::config`].
    pub const CONFIG: u8 = 0x20;
    /// Accumulated wheel ticks.
    pub const ENCODER: u8 = 0x90;
    /// Gyro samples.
    pub const GYRO: u8 = 0x98;
    /// Inertial unit.
    pub const IMU: u8 = 0x9A;
    /// Arm status.
    pub const ARM: u8 = 0xA0;
    /// Arm information.
    pub const ARM_INFO: u8 = 0xA1;
    /// Bytes from AUX1.
    pub const SERAUX: u8 = 0xB0;
    /// Bytes from AUX2.
    pub const SERAUX2: u8 = 0xB8;
    /// Compass module.
    pub const TCM2: u8 = 0xC0;
    /// List of sounds.
    pub const PLAYLIST: u8 = 0xD0;
    /// Gripper.
    pub const GRIPPER: u8 = 0xE0;
    /// Digital and analogue ports.
    pub const IO: u8 = 0xF0;
    /// Joystick.
    pub const JOYSTICK: u8 = 0xF8;
    /// Battery details.
    pub const BATTERY: u8 = 0xFA;
    /// Simulators: laser readings.
    pub const SIM_LASER: u8 = 0x60;
    /// Simulators: laser readings with reflectance.
    pub const SIM_LASER_EXTENDED: u8 = 0x61;
    /// Simulators: state, among it the true pose.
    pub const SIM_STAT: u8 = 0x62;
    /// Simulators: what they are.
    pub const SIM_INFO: u8 = 0x63;
    /// Simulators: the map changed.
    pub const SIM_MAP_CHANGED: u8 = 0x66;

    /// Whether a packet of this type is a standard SIP.
    pub const fn is_sip(kind: u8) -> bool {
        kind >= SIP_FIRST && kind <= SIP_LAST
    }
}

/// Bits of the SIP's FLAGS word.
pub mod flag {
    /// Motor power is on.
    pub const MOTORS: u16 = 1 << 0;
    /// Sonar arrays 1 to 4, a bit each.
    pub const SONAR_ARRAYS: u16 = 0b1111 << 1;
    /// The stop button is pressed.
    pub const STOP_BUTTON: u16 = 1 << 5;
    /// Stopped by E_STALL.
    pub const E_STALL: u16 = 1 << 6;
    /// Ledge ahead.
    pub const FAR_LEDGE: u16 = 1 << 7;
    /// Ledge below.
    pub const NEAR_LEDGE: u16 = 1 << 8;
    /// Joystick button.
    pub const JOYSTICK_BUTTON: u16 = 1 << 9;
    /// The charger gives power.
    pub const CHARGER_POWER: u16 = 1 << 10;
}

/// Line speeds by HOSTBAUD's code.
pub const BAUDS: [u32; 5] = [9600, 19200, 38400, 57600, 115_200];
