// From the manifest to running services on one host, and back.
#pragma once

#include <optional>
#include <string>

#include "train/gate.hpp"
#include "train/manifest.hpp"
#include "train/plan.hpp"

namespace railfix::tool {

/// Renders the manifest for this host as its next generation. Nothing is started. Services that would run exactly as
/// they do now keep their old entry. `made_of` is noted in the plan. Error: a file or program that is missing.
core::Result<HostPlan> install(const Manifest& manifest, const TrainHost& host, const std::filesystem::path& root,
                               const std::map<std::string, TopicLayouts>& made_of = {});

/// Starts a supervisor that outlives this process, if there is none, and waits until every service is healthy. Does not
/// wait for one that ends with exit code 2, which it would do again. Says what is waited for. Error: the plan was
/// written by another command after `as_of` (HostFolder::plan_written()).
core::Status bring_up(const std::filesystem::path& root, const HostPlan& plan, std::filesystem::file_time_type as_of,
                      const HealthGate& gate, const Say& say);
/// Ends the supervisor and its services.
core::Status bring_down(const std::filesystem::path& root);

/// Service by service in the order of the data's way: restarts those whose entry differs from what runs now; none when
/// they were made of other topics (IDL). When one does not pass the gate all of them go back to what ran before; then
/// the error says which, why, and whether that worked. Interrupted (see the gate) it stops where it is.
core::Status roll_out(const std::filesystem::path& root, const HostPlan& plan, const HealthGate& gate, const Say& say);

enum class Unfinished { nothing, upgrade, rollback };
/// What was interrupted: some services run as in the plan's generation, others as before.
Unfinished unfinished(const HostFolder& folder, const HostPlan& now);
/// After an interruption on the way from one plan to the other: which services run as in which, for the operator.
/// Nothing when all run as before.
std::optional<std::string> half_done(const HostFolder& folder, const HostPlan& before, const HostPlan& target);

/// What runs on this computer is of another train than the manifest, and what to do: a sentence. Nothing when it is
/// not, or when nothing is up.
std::optional<std::string> runs_another_train(const std::filesystem::path& root, const Manifest& manifest);

/// A service of this host runs, with or without a supervisor.
bool any_runs(const HostFolder& folder);

/// The lines of one settings text that the other has not, as "-line" and "+line"; empty when they are equal.
std::string difference(const std::string& before, const std::string& after);

}  // namespace railfix::tool
