"""KTX2 files that a graphics card takes as they are: BC7 (desktop) or ASTC 4x4 (mobile) with mip-maps, raw weight maps.

The encoders are optional: bc7enc (MIT) and astc_encoder (MIT). A container is a header, an index of levels, a data
format descriptor and the levels (KTX File Format Specification 2.0). alktx2, which writes supercompressed UASTC, states
no licence.
"""

from __future__ import annotations

import importlib.util
import struct
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
from PIL import Image

from facewright.compress.threads import THREADS, in_threads

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
# name: VkFormat (linear), bytes of a block, texels along its side, descriptor's colour model
FORMATS = {"bc7": (145, 16, 4, 134), "astc": (157, 16, 4, 162), "rgba8": (37, 4, 1, 1), "r32f": (100, 4, 1, 1)}
PACKAGES = {"bc7": ("bc7enc", "bc7enc-py"), "astc": ("astc_encoder", "astc-encoder-py")}


def encoder_missing(kind):
    """One sentence that says how to get the encoder of a kind ("bc7" or "astc"), or "" where it is installed."""
    module, package = PACKAGES[kind]
    if importlib.util.find_spec(module):
        return ""
    if kind == "bc7" and sys.platform == "darwin":
        return "KTX2 is left out: bc7enc-py has no build for macOS; pip install 'facewright[ktx2]' and use --ktx2 astc"
    return f"KTX2 is left out: {kind.upper()} needs {package}; pip install 'facewright[ktx2]'"


def encode_blocks(image, kind):
    """Blocks of an image (h, w, 4) uint8 as bytes."""
    height, width = image.shape[:2]
    if kind == "astc":
        from astc_encoder import ASTCConfig, ASTCContext, ASTCImage, ASTCProfile, ASTCSwizzle, ASTCType

        context = ASTCContext(ASTCConfig(ASTCProfile.LDR, 4, 4, 1, 60))
        source = ASTCImage(ASTCType.U8, width, height, data=image.tobytes())
        return bytes(context.compress(source, ASTCSwizzle.from_str("rgba")))
    import bc7enc

    params = bc7enc.bc7enc_compress_block_params_init()
    # Differences are no colours to look at: every channel counts alike.
    params.m_perceptual = False
    params.m_weights[:] = (1, 1, 1, 1)
    edges = [4 * (-(-height // 4) * i // (2 * THREADS)) for i in range(2 * THREADS)] + [height]
    bands = [slice(a, b) for a, b in pairwise(edges) if b > a]
    return b"".join(
        in_threads(
            lambda band: bc7enc.pack_dds(image[band].tobytes(), width, band.stop - band.start, "BC7", params=params),
            bands,
        )
    )


def decode_blocks(data, kind, height, width):
    """(h, w, 4) uint8 of blocks; BC7 by Pillow, which shares no code with the encoder."""
    if kind == "bc7":
        full = Image.frombytes("RGBA", (-(-width // 4) * 4, -(-height // 4) * 4), data, "bcn", 7, "BC7")
        return np.asarray(full)[:height, :width]
    from astc_encoder import ASTCConfig, ASTCContext, ASTCImage, ASTCProfile, ASTCSwizzle, ASTCType

    context = ASTCContext(ASTCConfig(ASTCProfile.LDR, 4, 4, 1, 60))
    image = ASTCImage(ASTCType.U8, width, height)
    context.decompress(data, image, ASTCSwizzle.from_str("rgba"))
    return np.frombuffer(image.data, np.uint8).reshape(height, width, 4)


def block_compressed(packed, kind="bc7", neutral=True):
    """An 8-bit Packed as a graphics card decodes it: its difference textures, and the neutral, through blocks."""

    def through(image):
        rgba = as_rgba(image)
        decoded = decode_blocks(encode_blocks(rgba, kind), kind, *rgba.shape[:2])
        return np.ascontiguousarray(decoded[:, :, : image.shape[2]])

    textures = np.stack([through(image) for image in packed.textures])
    return replace(packed, textures=textures, neutral=through(packed.neutral) if neutral else packed.neutral)


def as_rgba(image):
    """(h, w, 4) uint8 of an image of 1, 3 or 4 channels; grey goes into red, green and blue."""
    if image.shape[2] == 4:
        return image
    out = np.full((*image.shape[:2], 4), 255, np.uint8)
    out[:, :, :3] = image
    return out


def mip_levels(image):
    """The image and its halves down to one texel, each averaged from the one before (codes are affine in values)."""
    height, width, channels = image.shape
    levels, count = [image], max(height, width).bit_length()
    source = [Image.fromarray(image[:, :, c].astype(np.float32)) for c in range(channels)]
    for level in range(1, count):
        size = (max(1, width >> level), max(1, height >> level))
        source = [plane.resize(size, Image.Resampling.BOX) for plane in source]
        levels.append(np.rint(np.stack([np.asarray(plane) for plane in source], axis=2)).astype(image.dtype))
    return levels


def texture_ktx2(image, kind):
    """A KTX2 file, as bytes, of an image (h, w, C) with mip-maps, and its bytes on the card.

    16 bits become floats of 0 to 1: the only format that holds them exactly and that three.js opens, at twice the size.
    """
    levels = mip_levels(image)
    if image.dtype == np.uint16:
        payload, kind = [(level[:, :, 0] / np.float32(65535)).astype("<f4").tobytes() for level in levels], "r32f"
    else:
        payload = [encode_blocks(as_rgba(level), kind) for level in levels]
    return container(payload, kind, *image.shape[:2]), sum(map(len, payload))


def raw_ktx2(image):
    """A KTX2 file, as bytes, of an RGBA image (h, w, 4) uint8 without mip-maps, and its bytes on the card."""
    return container([image.tobytes()], "rgba8", *image.shape[:2]), image.nbytes


def container(levels, kind, height, width):
    """The KTX2 file of levels (largest first)."""
    vk_format, block, _, _ = FORMATS[kind]
    descriptor, keys = _descriptor(kind), _key_values({"KTXorientation": "rd", "KTXwriter": "facewright"})
    head = 12 + 9 * 4 + 4 * 4 + 2 * 8 + 24 * len(levels)
    end = head + len(descriptor) + len(keys)
    align = int(np.lcm(block, 4))
    body, places = bytearray(), []
    for data in reversed(levels):  # smallest first, as the format wants it
        body += bytes(-(end + len(body)) % align)
        places.insert(0, (end + len(body), len(data), len(data)))
        body += data
    header = struct.pack("<9I", vk_format, 4 if kind == "r32f" else 1, width, height, 0, 0, 1, len(levels), 0)
    index = struct.pack("<4I2Q", head, len(descriptor), head + len(descriptor), len(keys), 0, 0)
    return IDENTIFIER + header + index + b"".join(struct.pack("<3Q", *p) for p in places) + descriptor + keys + body


def _descriptor(kind):
    """Basic data format descriptor: linear, BT.709 primaries, alpha straight."""
    _, block, side, model = FORMATS[kind]
    if kind in ("bc7", "astc"):
        samples = [(0, 127, 0, 0, 0xFFFFFFFF)]
    elif kind == "r32f":
        samples = [(0, 31, 0xC0, 0xBF800000, 0x3F800000)]  # signed floats, -1 and 1
    else:
        samples = [(8 * i, 7, channel, 0, 255) for i, channel in enumerate((0, 1, 2, 15))]
    size = 24 + 16 * len(samples)
    words = struct.pack("<3I", size + 4, 0, 2 | size << 16)
    words += struct.pack("<4B", model, 1, 1, 0) + struct.pack("<8B", side - 1, side - 1, 0, 0, block, 0, 0, 0)
    words += bytes(4)
    for offset, length, channel, lower, upper in samples:
        words += struct.pack("<HBB4BII", offset, length, channel, 0, 0, 0, 0, lower, upper)
    return words


def _key_values(pairs):
    out = b""
    for key, value in sorted(pairs.items()):
        entry = key.encode() + b"\0" + value.encode() + b"\0"
        out += struct.pack("<I", len(entry)) + entry + bytes(-len(entry) % 4)
    return out
