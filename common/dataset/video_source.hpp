// The pictures of a video file.
#pragma once

#include "dataset/dataset.hpp"

namespace railfix::dataset {

using MaybePicture = core::Result<std::optional<Picture>>;
using MaybeSource = core::Result<std::unique_ptr<PictureSource>>;

/// Of folders, and of videos that do not say their rate.
constexpr double kDefaultFps = 30.0;

MaybeSource open_video(const std::filesystem::path& file, const PictureOptions& options);

}  // namespace railfix::dataset
