// Images as an operator gets them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "images.hpp"
#include "support/npm.hpp"

namespace railfix::test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(Images, SayWhatTheyAreAndRunAsNobodyInParticular) {
  const auto said = shell("podman image inspect railfix/fusion:test");
  ASSERT_EQ(said.exit_code, 0) << said.err;
  const auto image = nlohmann::json::parse(said.out)[0];
  EXPECT_EQ(image["Config"]["User"], "990:990");
  const auto labels = image["Config"]["Labels"];
  EXPECT_EQ(labels["org.railfix.service"], "fusion");
  EXPECT_EQ(labels["org.opencontainers.image.version"], "test");
  EXPECT_EQ(labels["org.railfix.idl"].get<std::string>().size(), 64U);
  EXPECT_NE(labels["org.opencontainers.image.revision"], "");
  EXPECT_EQ(image["Healthcheck"]["Test"], nlohmann::json({"CMD", "/usr/bin/railfix-service", "--health"}));
  // Nobody runs there: the health check must say so, and not that all is well.
  const auto health = shell("podman run --rm --no-healthcheck --env RAILFIX_CONFIG= railfix/fusion:test --health");
  EXPECT_EQ(health.exit_code, 1) << health.err;
  EXPECT_THAT(health.out, HasSubstr("fusion: does not run here"));
}

TEST_F(Images, ShareTheLayersOfWhatTheyHaveInCommon) {
  const auto layers = [](const std::string& service) {
    const auto said = shell("podman image inspect railfix/" + service + ":test");
    return nlohmann::json::parse(said.out)[0]["RootFS"]["Layers"].get<std::vector<std::string>>();
  };
  const auto one = layers("fusion");
  const auto other = layers("tpr-publisher");
  const auto differ = std::mismatch(one.begin(), one.end(), other.begin(), other.end()).first;
  EXPECT_GE(differ - one.begin(), 4) << "base, user, packages of all, packages of those that know the map";
}

// OpenCV's own readers of pictures and films would bring 300 MB of formats.
TEST_F(Images, ThatOfTheCameraIsSmallAndItsPluginsLoad) {
  const auto size = shell("podman image inspect --format '{{.Size}}' railfix/frame-grabber:test");
  ASSERT_EQ(size.exit_code, 0) << size.err;
  EXPECT_LT(std::stod(size.out), 260e6);
  const auto needed = shell(
      "podman run --rm --no-healthcheck --entrypoint sh railfix/frame-grabber:test -c "
      "'ls /usr/lib/*/gstreamer-1.0/libgstvideo4linux2.so && ldd /usr/lib/*/gstreamer-1.0/*.so "
      "/usr/lib/*/libsoup-3.0.so.0'");
  ASSERT_EQ(needed.exit_code, 0) << needed.err;
  EXPECT_THAT(needed.out, HasSubstr("libv4l2.so.0 => /"));
  EXPECT_THAT(needed.out, Not(HasSubstr("not found")));
  const auto bill = shell(
      "podman run --rm --no-healthcheck --entrypoint cat railfix/frame-grabber:test /usr/share/railfix/sbom.cdx.json");
  EXPECT_THAT(bill.out, HasSubstr("gstreamer1.0-plugins-good"));
}

TEST_F(Images, CarryAValidBillOfMaterials) {
  if (!npm_is_there()) GTEST_SKIP() << "skipped: npm is not there";
  const auto sbom = kWork / "sbom.json";
  const auto text = shell(
      "podman run --rm --no-healthcheck --entrypoint cat railfix/tpr-publisher:test "
      "/usr/share/railfix/sbom.cdx.json >'" +
      sbom.string() + "'");
  ASSERT_EQ(text.exit_code, 0) << text.err;
  ASSERT_EQ(install_script(kSource / "tests/integration/containers", "validate.mjs", kWork), "");
  const auto in_work = "cd '" + kWork.string() + "' && ";
  const auto valid = shell(in_work + "node validate.mjs sbom.json");
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;
  const auto broken =
      shell(in_work + "sed 's/\"library\"/\"libary\"/' sbom.json >broken.json && node validate.mjs broken.json");
  EXPECT_EQ(broken.exit_code, 1) << "the check above could not fail";

  const auto bill = nlohmann::json::parse(std::ifstream(sbom));
  std::map<std::string, nlohmann::json> parts;
  for (const auto& part : bill["components"]) parts[part["name"]] = part;
  for (const char* name : {"libfastrtps2.9", "libmosquitto1", "libsqlite3-0", "libc6"})
    EXPECT_TRUE(parts.contains(name)) << name;
  EXPECT_TRUE(parts.contains("libeigen3-dev") || parts.contains("libcli11-dev")) << "nothing that was compiled in";
  const auto sum = shell(
      "podman run --rm --no-healthcheck --entrypoint sha256sum railfix/tpr-publisher:test "
      "/usr/bin/railfix-tpr-publisher");
  EXPECT_THAT(sum.out, HasSubstr(parts["railfix-tpr-publisher"]["hashes"][0]["content"].get<std::string>()));
}

}  // namespace
}  // namespace railfix::test
