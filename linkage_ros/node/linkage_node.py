# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_node: runs a mechanism on ROS 2, and publishes its states and driving torque.

Public: other packages may import `LinkageNode`.
"""

import atexit
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, cast

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions, get_current_signal_handlers_options

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError, LinkageError, import_failure, one_line
from linkage_ros.messages.cdr import ERROR, OK, Status, encode_diagnostics
from linkage_ros.messages.topics import DIAGNOSTICS, prefix_of
from linkage_ros.node.endpoints import create_publisher
from linkage_ros.node.health import ACTIVE
from linkage_ros.node.live_run import LiveRun
from linkage_ros.node.parameter_node import ParameterNode
from linkage_ros.node.process import reported_as_configuration, run_program
from linkage_ros.node.workers import accompany_ticker
from linkage_ros.quantities import leaves
from linkage_ros.settings.configuration import Configuration, configure, preset_note
from linkage_ros.settings.help import node_parser
from linkage_ros.settings.notes import notes
from linkage_ros.settings.parameters import OF_THE_RUN, Session
from linkage_ros.settings.summary import summary

SUCCESS, FAILURE, FAULT = (
    TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE,
    TransitionCallbackReturn.ERROR,
)  # fmt: skip
# States of a managed node; ACTIVE is another one.
_UNCONFIGURED, _INACTIVE, _FINALIZED = 'unconfigured', 'inactive', 'finalized'
_MOVING = '', ACTIVE  # '': the node is not managed

_NAME = 'linkage_node'
(_MANAGED,) = (leaf.quantity for leaf in leaves(Session) if leaf.name == 'managed')
_REPORT_SECONDS, _WATCH_SECONDS = 1.0, 0.05  # between reports, and between looks for news
# Time for a tick to end when the node is deactivated, s; a longer one counts as hanging.
_HANGING_SECONDS = 2.0


class LinkageNode(LifecycleNodeMixin, ParameterNode):  # type: ignore[misc]  # rclpy has no types
    """Publishes the states of one or several linkages.

    With the parameter managed, it is a lifecycle node; otherwise, its motion starts with `work` or
    `start`, and it has no services of a lifecycle node.

    Published topics: those of the states, while they have subscribers; robot_description;
    and /diagnostics, once a second.
    Subscribed topics: /clock, if use_sim_time is true; commands or measurements, depending on the
    drive.
    Parameters: those of the configuration. rpm, motor.torque and, unless the drive is a torque,
    gravity may be set at any time, for all linkages without a value of their own, or for one.
    """

    def __init__(self, stop: cli.Stop | None = None, *, name: str = _NAME, **options: Any) -> None:
        """Creates the node and, unless it is managed, all that its motion needs.

        Args:
            stop: Request to end the program; the node makes it if its motion ends.
            name: Name of the node, which arguments may change.
            options: Options of `rclpy.node.Node`.

        Raises:
            ConfigurationError: The parameters cannot be used.
            LogError: The log cannot be created.
            ViewerError: The view cannot be opened.
            ImportError: MCAP or Rerun is not installed.
        """
        ParameterNode.__init__(self, name, **options)
        self._stop = stop or cli.Stop(handles_signals=False)
        self._run: LiveRun | None = None
        self._endpoints = set[Any]()  # publishers and subscriptions of the run
        self._own = dict[str, set[str]]()  # names of parameters of each linkage's own
        self._state = ''  # of a managed node
        self._trouble = ''  # the error for which it is unconfigured
        self._has_failed = self._is_over = self._must_end = False
        # Held by transitions of a managed node, by reports, and by the end.
        self._lock = threading.RLock()
        self._thread: threading.Thread | None = None  # see `start`
        self._on_failure: Callable[[], object] = self._stop.set
        try:
            with reported_as_configuration():  # a remapped name may be invalid
                self._diagnostics = create_publisher(self, DIAGNOSTICS)
            if _MANAGED.clean('managed', self.given.get('managed', False)):
                self._manage()
            else:
                self._configure()
        except BaseException:
            self.destroy_node()  # the caller has no node to destroy
            raise

    def _manage(self) -> None:
        """Becomes a lifecycle node, which is unconfigured."""
        LifecycleNodeMixin.__init__(self)
        for service in self.services:
            if service.srv_type is ChangeState:
                self._change_state, service.callback = service.callback, self._change_or_refuse
        self._on_failure = self.create_guard_condition(self._leave_active).trigger
        self._state = _UNCONFIGURED
        self.open_parameters()

    def _configure(self) -> None:
        """Checks the parameters, and prepares the motion; see `LiveRun`."""
        given, configuration = dict(self.given), configure(self.given)
        _require_zeros_can_be_sent(configuration)
        self._own = {name: {*names} for name, names in configuration.own.items()}
        self._declare_all(configuration)
        before = {*self.publishers, *self.subscriptions}
        try:
            self._run = LiveRun(self, configuration, self._diagnostics, self._on_failure)
        finally:
            self._endpoints = {*self.publishers, *self.subscriptions} - before
        for name, linkage in self._run.linkages.items():
            words = summary(linkage.simulator.linkage, linkage.simulator.solver)
            self.get_logger().info(f'{preset_note(given)}{prefix_of(name, ": ")}{words}')
        for line in (*notes(configuration), *self._run.notes()):
            self.get_logger().warning(line)
        self._run.announce()

    def _declare_all(self, configuration: Configuration) -> None:
        """Declares the parameters, and those of each linkage that may be set while running."""
        values, known = configuration.parameters(), configuration.leaves()
        for linkage in configuration.linkages:
            prefix, own = prefix_of(linkage.name, '.'), linkage.parameters()
            for name, value in own.items():
                full_name = name if name in OF_THE_RUN else f'{prefix}{name}'
                if known[full_name].quantity.live:
                    values.setdefault(f'{prefix}{name}', value)
            if 'start_rpm' not in own and 'rpm' in own:
                values[f'{prefix}start_rpm'] = own['rpm']  # the effective default
        self.declare(known.values(), values)

    # ------------------------------------------------------------ from start to end

    def start(self) -> None:
        """Runs `work` in a thread, once, in a program with an executor of its own.

        The motion ends with the program, also if an error ends that before `end`.
        """
        if not self._thread:
            atexit.register(self.end)
            self._thread = threading.Thread(target=self.work, name=_NAME, daemon=True)
            self._thread.start()

    def work(self) -> int:
        """Runs the motion, unless the node is managed, until the end; returns the exit code."""
        with self._lock:
            if self._run and not self._state:
                self._run.start()
        self._report_until_stop()
        return self._end()

    def end(self) -> int:
        """Ends the motion, with a torque of 0 and a complete log; returns the exit code."""
        self._must_end = True
        atexit.unregister(self.end)
        if self._thread:
            self._thread.join()
        return self._end()

    def destroy_node(self) -> None:
        """Ends the motion, and destroys the node."""
        self.end()
        super().destroy_node()

    def _report_until_stop(self) -> None:
        """Reports once a second, and when a source of messages is lost or returns.

        Real time counts, because simulated time may be paused.
        """
        accompany_ticker()  # a tick may wait for the interpreter lock that a report holds
        due = time.monotonic() + _REPORT_SECONDS
        while not (self._must_end or self._stop.wait(_WATCH_SECONDS)):
            if self._lock.acquire(blocking=False):  # otherwise, a transition is under way
                now = time.monotonic()
                try:
                    self._report(only_news=now < due)
                finally:
                    self._lock.release()
                if now >= due:
                    due = max(due + _REPORT_SECONDS, now)

    def _report(self, *, only_news: bool = False) -> None:
        """Publishes the diagnostics; any error ends the motion.

        Args:
            only_news: Whether to do so only if a source of messages was lost or has returned.
        """
        is_moving = self._state in _MOVING
        try:
            if not only_news or (self._run and is_moving and self._run.has_news()):
                self._diagnose()
        except Exception as error:  # noqa: BLE001, the torque must end
            if self._run and is_moving:
                self._run.fail(error)
            else:
                self._has_failed = True
                words = one_line(f'{type(error).__name__}: {error}')
                self.get_logger().error(f'the diagnostics failed: {words}')

    def _diagnose(self) -> None:
        if self._run:
            self._run.report(self._state)
            return
        name, level = self.get_fully_qualified_name().lstrip('/'), ERROR if self._trouble else OK
        words = f'{self._state}: {self._trouble}' if self._trouble else self._state
        status = Status(level, f'{name}: motion', words, {'state': self._state})
        now = self.get_clock().now().nanoseconds
        self._diagnostics.publish(encode_diagnostics(now, '', [status]))

    def _end(self) -> int:
        """Ends the motion in any state; returns the exit code."""
        while not self._lock.acquire(timeout=_WATCH_SECONDS):  # a transition lasts
            if self._stop.is_urgent():
                return 1
        try:
            if not self._is_over and self._run:
                is_moving, cause = self._state in _MOVING, self._stop.signal or 'end'
                if self._state:  # the node is managed
                    self._state = _FINALIZED
                if not is_moving or self._run.pause(cause, self._stop.join):
                    self._report()
                else:
                    self._has_failed = True
                self._close()
            self._is_over = True
        finally:
            self._lock.release()
        return 1 if self._has_failed else 0

    def _close(self) -> bool:
        """Completes log and view of the run, if any; returns whether the log is complete."""
        run, self._run = self._run, None
        if not run:
            return True
        is_complete = run.close(self._stop.join)
        self._has_failed |= not is_complete or run.has_failed
        return is_complete

    # ------------------------------------------------------------ transitions of a managed node

    def on_configure(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Checks the parameters, opens log and view, and prepares the motion."""
        return self._change(_INACTIVE, self._try_to_configure)

    def on_activate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Starts the motion, or continues it where it was deactivated."""
        return self._change(ACTIVE, self._activate)

    def on_deactivate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Stops the motion, and ends the torques."""
        return self._change(_INACTIVE, lambda: self._deactivate('deactivate'))

    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Completes log and view, and forgets the motion."""
        return self._change(_UNCONFIGURED, self._clean_up)

    def on_shutdown(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Ends the motion in any state."""
        return self._change(_FINALIZED, self._shut_down)

    def on_error(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Cleans up after an error, so that the node can be configured again."""
        return self._change(_UNCONFIGURED, self._recover)

    def _change(
        self, state: str, act: Callable[[], TransitionCallbackReturn]
    ) -> TransitionCallbackReturn:
        """Changes to a state if an action succeeds; returns the result of the action."""
        with self._lock:
            if self._is_over:
                return FAILURE
            try:
                result = act()
            except (LinkageError, ImportError, OSError) as error:  # the user can correct it
                words = import_failure(error) if isinstance(error, ImportError) else str(error)
                result = FAILURE
            except Exception as error:  # noqa: BLE001, rclpy would not report it
                result, words = FAULT, f'{type(error).__name__}: {error}'
            else:
                words = ''
            if words:
                self._trouble = one_line(words)
                self.get_logger().error(self._trouble)
            if result is SUCCESS or state == _FINALIZED:
                self._state = state
        return result

    def _try_to_configure(self) -> TransitionCallbackReturn:
        self._trouble = ''
        try:
            self._configure()
        except BaseException:
            self._forget()
            raise
        return SUCCESS

    def _activate(self) -> TransitionCallbackReturn:
        self._configured.resume()
        return SUCCESS

    def _deactivate(self, cause: str) -> TransitionCallbackReturn:
        """Stops the motion; an error of the motion, or a tick that hangs, is a fault."""
        run = self._configured
        if not run.pause(cause, partial(self._stop.join, timeout=_HANGING_SECONDS)):
            self._trouble = 'a tick hangs'
        elif run.error:
            self._trouble = one_line(str(run.error))
        else:
            return SUCCESS
        self._has_failed = True
        return FAULT

    def _clean_up(self) -> TransitionCallbackReturn:
        is_complete = self._close()
        self._forget()
        if not is_complete:
            self._trouble = self._trouble or 'the log is incomplete'
        return SUCCESS if is_complete else FAULT

    def _recover(self) -> TransitionCallbackReturn:
        self._clean_up()
        return SUCCESS

    def _shut_down(self) -> TransitionCallbackReturn:
        """Ends the motion and the run."""
        stopped = self._deactivate('shutdown') if self._state == ACTIVE else SUCCESS
        cleaned = self._clean_up()
        return SUCCESS if stopped is cleaned is SUCCESS else FAILURE

    @property
    def _configured(self) -> LiveRun:
        """The run, in transitions from a state in which there is one."""
        return cast('LiveRun', self._run)

    def _forget(self) -> None:
        """Destroys what the run used, and opens the parameters for other values."""
        for publisher in self._endpoints & {*self.publishers}:
            self.destroy_publisher(publisher)
        for subscription in self._endpoints & {*self.subscriptions}:
            self.destroy_subscription(subscription)
        self.open_parameters()

    def _leave_active(self) -> None:
        """Leaves the active state after an error of the motion."""
        if self._state == ACTIVE:
            self.trigger_deactivate()

    def _change_or_refuse(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        """Answers a request of a transition; rclpy 7 does not answer an impossible one."""
        try:
            return self._change_state(request, response)
        except RuntimeError as error:
            asked = request.transition.label or request.transition.id
            words = one_line(str(error))
            self.get_logger().warning(f'no transition {asked} from {self._state}: {words}')
            response.success = False
            return response

    def set_live(self, name: str, value: Any) -> None:
        """Sets a parameter of one linkage, or of all that have no value of their own."""
        linkages = self._configured.linkages
        first, _, rest = name.partition('.')
        if first in self._own:
            self._own[first].add(rest)
            linkages[first].set_live(rest, value)
            return
        for linkage in linkages.values():
            if name in self._own.get(linkage.name, ()):
                continue
            linkage.set_live(name, value)
            if linkage.name:
                self.show_value(f'{linkage.name}.{name}', value)


def _require_zeros_can_be_sent(configuration: Configuration) -> None:
    """Refuses commands of torques in a program in which a signal ends ROS before the torques.

    Raises:
        ConfigurationError: rclpy handles signals.
    """
    drive = configuration.linkages[0].drive
    topic = drive.effort_command_topic or drive.trajectory_command_topic
    if topic and get_current_signal_handlers_options() != SignalHandlerOptions.NO:
        raise ConfigurationError(
            f"the torque on {topic} could not be ended, because rclpy's signal handlers end ROS "
            'at once: call rclpy.init(signal_handler_options=SignalHandlerOptions.NO)'
        )


def main() -> int:
    """Runs `linkage_node`; returns the exit code. `cli.run` reports its errors."""
    return run_program(sys.argv, node_parser(), LinkageNode)


if __name__ == '__main__':
    sys.exit(cli.leave(cli.run(_NAME, main)))
