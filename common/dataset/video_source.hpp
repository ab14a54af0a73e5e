// The pictures of a video file.
#pragma once

#include "dataset/dataset.hpp"

namespace railfix::dataset {

using MaybePicture = core::Result<std::optional<Picture>>;
using MaybeSource = core::Result<std::unique_ptr<PictureSource>>;

/// Stamps are the film's own times since its first picture; a frame whose time is missing or not behind the one before
/// is a broken picture. Where PictureOptions::fps is given, they are frame number / fps whatever the film says.
MaybeSource open_video(const std::filesystem::path& file, const PictureOptions& options);

}  // namespace railfix::dataset
